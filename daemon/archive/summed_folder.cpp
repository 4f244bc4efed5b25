// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/summed_folder.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <ctime>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "algo/base/bounded_json.hpp"
#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "daemon/database/schema.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "drivers/files/file_io.hpp"
#include "words/backup.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kEncryption = "encryption";
constexpr const char* kSignature = "signature";
constexpr std::size_t kMaxAbout = std::size_t{16} << 20, kMaxSums = std::size_t{512} << 20;
constexpr std::size_t kMaxProblems = 1000;
constexpr const char* kArchive = "archive";  // in the hidden folder of one that is being written
constexpr const char* kUnpacked = ".unpacked";
constexpr const char* kAgeSuffix = ".age";

/// True for an archive that Plumb has written: another file is never replaced by one.
bool IsArchiveOf(const fs::path& file, const SummedKind& kind) {
  try {
    const TarReader tar(file);
    const Json about = ParseBoundedJsonOrNothing<Json>(tar.Text(kind.about_file, kMaxAbout));
    return tar.entries().contains(kSumsFile) && about.is_object() && about.contains("format") &&
           about.contains("sha256sums");
  } catch (const std::runtime_error&) {
    return false;
  }
}

OutputKind OutputAt(const fs::path& target, const SummedKind& kind, OutputKind output) {
  // Nobody here can look into one for which only the recipients have a key.
  if (target.extension() == kAgeSuffix)
    output.may_replace = IsAgeFile;
  else if (IsTarName(target))
    output.may_replace = [kind](const fs::path& file) { return IsArchiveOf(file, kind); };
  return output;
}

}  // namespace

fs::path EncryptedName(fs::path target, const AgeRecipients& recipients) {
  if (recipients.empty() || target.extension() == kAgeSuffix) return target;
  if (!IsTarName(target)) target += ".tar";
  return target += kAgeSuffix;
}

std::vector<std::string> FilesBelow(const fs::path& top, const fs::path& folder) {
  std::vector<std::string> files;
  std::error_code error;
  fs::recursive_directory_iterator entry(folder, error);
  for (const fs::recursive_directory_iterator end; !error && entry != end; entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_regular_file(ignored)) files.push_back(entry->path().lexically_relative(top));
  }
  if (error && error != std::errc::no_such_file_or_directory)
    throw IoError(say::backup::NotListed(folder.string(), error.message()));
  std::sort(files.begin(), files.end());
  return files;
}

SummedWriter::SummedWriter(const fs::path& target, const SummedKind& kind, OutputKind output,
                           const AgeRecipients& recipients, std::stop_token stop, ArchiveTap tap)
    : kind_(kind),
      output_(target, OutputAt(target, kind, std::move(output))),
      stop_(std::move(stop)),
      tap_(std::move(tap)) {
  if ((target.extension() == kAgeSuffix) == recipients.empty())
    throw InvalidRequest(say::backup::NoRecipient(target.string()));
  ::chmod(output_.path().c_str(), 0700);  // it contains patients' data
  if (IsTarName(target))
    tar_ = std::make_unique<TarWriter>(output_.path() / kArchive, recipients, tap_.take);
}

TarWriter::Added SummedWriter::Copied(const fs::path& from, const std::string& path) {
  TarWriter::Added added;
  if (tar_)
    added = tar_->Add(from, path, stop_);
  else
    added.digest = CloneOrCopy(from, output_.path(), path, stop_);
  sums_ += fmt::format("{}  {}\n", added.digest.sha256, path);
  ++files_;
  bytes_ += added.digest.bytes;
  return added;
}

std::string SummedWriter::Add(const fs::path& from, const std::string& path) {
  CheckStop(stop_);
  if (!IsPlainPath(path)) {
    Report(say::backup::FileLeftOut(fmt::format("{:?}", path)));
    return {};
  }
  try {
    TarWriter::Added added = Copied(from, path);
    if (!added.problem.empty()) Report(std::move(added.problem));
    return added.digest.sha256;
  } catch (const SourceUnreadable& error) {
    Report(error.message());
    return {};
  }
}

void SummedWriter::AddOwn(const fs::path& from, const std::string& path) {
  const TarWriter::Added added = Copied(from, path);
  if (!added.problem.empty()) throw IoError(added.problem);
}

void SummedWriter::Report(Message problem) {
  if (problems_.size() < kMaxProblems) problems_.push_back(std::move(problem));
}

void SummedWriter::Commit(Json about) {
  Sha256 sums;
  sums.Add(sums_.data(), sums_.size());
  about["format"] = kind_.format;
  about["schema"] = kSchemaVersion;
  about["made_at"] = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  about["files"] = files_;
  about["bytes"] = bytes_;
  about["sha256sums"] = sums.Hex();
  about["problems"] = EnglishTexts(problems_);
  about["problem_messages"] = MessagesJson(problems_);
  const std::string text = about.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  if (!tar_) {
    WriteWholeFile(output_.path() / kSumsFile, std::string_view(sums_));
    WriteWholeFile(output_.path() / kind_.about_file, std::string_view(text));
    return output_.Commit();
  }
  tar_->AddText(kSumsFile, sums_);
  tar_->AddText(kind_.about_file, text);
  tar_->Close();
  if (tap_.before_commit) tap_.before_commit();
  output_.CommitFile(output_.path() / kArchive);
}

SummedReader::SummedReader(fs::path folder, SummedKind kind, const BackupKeys& keys,
                           const fs::path& scratch, const std::stop_token& stop)
    : folder_(std::move(folder)), kind_(std::move(kind)) {
  Json about;
  std::string text;
  try {
    OpenArchive(keys, scratch, stop);
    about = ParseBoundedJsonOrNothing<Json>(Text(kind_.about_file, kMaxAbout));
    text = Text(kSumsFile, kMaxSums);
  } catch (const DataError& error) {
    Fail(error.message());
  }
  if (!about.is_object() || about.value("format", Json()) != kind_.format)
    Fail(say::backup::OtherFormat(kind_.about_file, kind_.format));
  const Json schema = about.value("schema", Json());
  if (!schema.is_number_integer() || schema > kSchemaVersion) Fail(say::backup::NewerVersion());
  digest_ = Digest(kSumsFile, {}).sha256;
  if (about.value("sha256sums", Json()) != digest_) Fail(say::backup::SumsChanged(kSumsFile));
  const bool is_encrypted = about.contains(kEncryption);
  const bool has_key = keys.identity != nullptr || keys.secret != nullptr;
  if (is_encrypted && keys.secret == nullptr) Fail(say::backup::WithoutKey());
  if (!is_encrypted && has_key && !IsAgeFile(folder_)) Fail(say::backup::NotEncrypted());
  if (is_encrypted) {
    try {
      cipher_ = std::make_unique<FileCipher>(*keys.secret, about[kEncryption]);
    } catch (const DataError& error) {
      Fail(error.message());
    }
    if (about.value(kSignature, Json()) != cipher_->Signature(text))
      Fail(say::backup::NotSigned(kSumsFile));
  }
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    begin = end + 1;
    constexpr std::size_t kHex = 64;
    if (line.size() < kHex + 3 || line.substr(kHex, 2) != "  " ||
        !IsPlainPath(line.substr(kHex + 2)) || !kind_.may_hold(line.substr(kHex + 2)))
      Fail(say::backup::WrongLine(kSumsFile, kind_.name, fmt::format("{:?}", line.substr(0, 120))));
    files_.push_back({.path = line.substr(kHex + 2), .sha256 = line.substr(0, kHex)});
  }
  if (tar_ && tar_->entries().size() != files_.size() + 2)
    Fail(say::backup::WrongNumber(static_cast<std::int64_t>(tar_->entries().size()),
                                  static_cast<std::int64_t>(files_.size() + 2)));
}

void SummedReader::OpenArchive(const BackupKeys& keys, const fs::path& scratch,
                               const std::stop_token& stop) {
  std::error_code error;
  if (!fs::is_regular_file(folder_, error)) return;
  if (!IsAgeFile(folder_)) {
    tar_ = std::make_unique<TarReader>(folder_);
  } else {
    if (keys.identity == nullptr) throw DataError(say::backup::WithoutIdentity());
    tar_ = std::make_unique<TarReader>(Decrypted(folder_, *keys.identity, scratch, stop), folder_);
  }
  for (const auto& [path, entry] : tar_->entries()) {
    if (path != kSumsFile && path != kind_.about_file && !kind_.may_hold(path))
      throw DataError(
          say::backup::WrongEntry(fmt::format("{:?}", path.substr(0, 120)), kind_.name));
  }
}

std::string SummedReader::Text(const char* name, std::size_t max_bytes) const {
  return tar_ ? tar_->Text(name, max_bytes) : ReadTextFile(folder_ / name, max_bytes);
}

FileDigest SummedReader::Digest(const std::string& path, const std::stop_token& stop) const {
  return tar_ ? tar_->Digest(path, stop) : DigestOfFile(folder_, path, stop);
}

FileDigest SummedReader::CopyPlain(const fs::path& to, const std::string& path,
                                   const std::stop_token& stop) const {
  return tar_ ? tar_->CopyTo(to, path, stop) : Copy(folder_, to, path, stop);
}

/// An encrypted file of an archive is unpacked beside its copy first.
FileCipher::Written SummedReader::Open(const fs::path& to, const std::string& path,
                                       const std::stop_token& stop) const {
  if (!tar_) return cipher_->Open(folder_, to, path, stop);
  const fs::path unpacked = to / kUnpacked;
  (void)tar_->CopyTo(unpacked, path, stop);
  FileCipher::Written both = cipher_->Open(unpacked, to, path, stop);
  std::error_code ignored;
  fs::remove_all(unpacked, ignored);
  return both;
}

void SummedReader::Verify(const std::stop_token& stop) const {
  std::size_t wrong = 0;
  Message first;
  for (const FileDigest& file : files_) {
    Message why;
    try {
      if (Digest(file.path, stop).sha256 != file.sha256)
        why = say::backup::WrittenFileChanged(file.path);
    } catch (const IoError& error) {
      why = error.message();
    }
    if (why.empty()) continue;
    ++wrong;
    if (first.empty()) first = why;
  }
  if (wrong > 0)
    Fail(say::backup::Damaged(static_cast<std::int64_t>(wrong),
                              static_cast<std::int64_t>(files_.size()), first));
}

FileDigest SummedReader::CopyTo(const fs::path& to, const FileDigest& file,
                                const std::stop_token& stop) const {
  FileDigest copy, read;
  try {
    if (cipher_) {
      const FileCipher::Written both = Open(to, file.path, stop);
      copy = both.plain;
      read = both.sealed;
    } else {
      copy = read = CopyPlain(to, file.path, stop);
    }
  } catch (const SourceUnreadable& error) {
    Fail(error.message());
  } catch (const DataError& error) {
    Fail(error.message());
  }
  if (read.sha256 != file.sha256) Fail(say::backup::ChangedWhileCopied(file.path));
  return copy;
}

void SummedReader::Fail(Message why) const {
  throw DataError(say::backup::Unusable(kind_.name, folder_.string(), std::move(why)));
}

}  // namespace plumb

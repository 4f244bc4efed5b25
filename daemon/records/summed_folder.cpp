#include "daemon/records/summed_folder.hpp"

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
#include "daemon/records/file_copy.hpp"
#include "daemon/records/schema.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kEncryption = "encryption";
constexpr const char* kSignature = "signature";
constexpr std::size_t kMaxAbout = std::size_t{16} << 20, kMaxSums = std::size_t{512} << 20;
constexpr std::size_t kMaxProblems = 1000;
/// In the hidden folder of an archive that is being written; the latter of one that is read, too.
constexpr const char* kArchive = "archive";
constexpr const char* kUnpacked = ".unpacked";

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
  if (IsTarName(target))
    output.may_replace = [kind](const fs::path& file) { return IsArchiveOf(file, kind); };
  return output;
}

}  // namespace

std::vector<std::string> FilesBelow(const fs::path& top, const fs::path& folder) {
  std::vector<std::string> files;
  std::error_code error;
  fs::recursive_directory_iterator entry(folder, error);
  for (const fs::recursive_directory_iterator end; !error && entry != end; entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_regular_file(ignored)) files.push_back(entry->path().lexically_relative(top));
  }
  if (error && error != std::errc::no_such_file_or_directory)
    throw IoError(fmt::format("cannot list {}: {}", folder.string(), error.message()));
  std::sort(files.begin(), files.end());
  return files;
}

SummedWriter::SummedWriter(const fs::path& target, const SummedKind& kind, OutputKind output,
                           const BackupSecret* secret, std::stop_token stop)
    : kind_(kind),
      output_(target, OutputAt(target, kind, std::move(output))),
      place_(output_.path()),
      cipher_(secret != nullptr ? std::make_unique<FileCipher>(*secret) : nullptr),
      stop_(std::move(stop)) {
  ::chmod(output_.path().c_str(), 0700);  // it contains patients' data
  if (!IsTarName(target)) return;
  tar_ = std::make_unique<TarWriter>(output_.path() / kArchive);
  place_ /= kUnpacked;
}

void SummedWriter::Pack(const std::string& path) {
  if (!tar_) return;
  tar_->Add(place_, path, stop_);
  if (::unlink((place_ / path).c_str()) != 0)
    throw IoError(DescribeWriteError(place_ / path, errno));
}

std::string SummedWriter::Copied(const fs::path& from, const std::string& path) {
  FileDigest plain, written;
  if (cipher_) {
    const FileCipher::Written both = cipher_->Seal(from, place_, path, stop_);
    plain = both.plain;
    written = both.sealed;
  } else {
    plain = written = CloneOrCopy(from, place_, path, stop_);
  }
  Pack(path);
  sums_ += fmt::format("{}  {}\n", written.sha256, path);
  ++files_;
  bytes_ += plain.bytes;
  return plain.sha256;
}

std::string SummedWriter::Add(const fs::path& from, const std::string& path) {
  CheckStop(stop_);
  if (!IsPlainPath(path)) {
    Report(fmt::format("a file is left out, its name has control characters: {:?}", path));
    return {};
  }
  try {
    return Copied(from, path);
  } catch (const SourceUnreadable& error) {
    Report(error.what());
    return {};
  }
}

void SummedWriter::AddOwn(const fs::path& from, const std::string& path) {
  (void)Copied(from, path);
}

void SummedWriter::Report(std::string problem) {
  if (problems_.size() < kMaxProblems) problems_.push_back(std::move(problem));
}

void SummedWriter::Commit(Json about) {
  std::error_code error;
  fs::create_directories(place_, error);
  if (error) throw IoError(DescribeWriteError(place_, error.value()));
  WriteWholeFile(place_ / kSumsFile, std::string_view(sums_));
  about["format"] = kind_.format;
  about["schema"] = kSchemaVersion;
  about["made_at"] = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  about["files"] = files_;
  about["bytes"] = bytes_;
  about["sha256sums"] = DigestOfFile(place_, kSumsFile).sha256;
  about["problems"] = problems_;
  if (cipher_) {
    about[kEncryption] = cipher_->Header();
    about[kSignature] = cipher_->Signature(sums_);
  }
  WriteWholeFile(place_ / kind_.about_file,
                 about.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  if (!tar_) return output_.Commit();
  Pack(kSumsFile);
  Pack(kind_.about_file);
  tar_->Close();
  output_.CommitFile(output_.path() / kArchive);
}

SummedReader::SummedReader(fs::path folder, SummedKind kind, const BackupSecret* secret)
    : folder_(std::move(folder)), kind_(std::move(kind)) {
  Json about;
  std::string text;
  try {
    OpenArchive();
    about = ParseBoundedJsonOrNothing<Json>(Text(kind_.about_file, kMaxAbout));
    text = Text(kSumsFile, kMaxSums);
  } catch (const DataError& error) {
    Fail(error.what());
  }
  if (!about.is_object() || about.value("format", Json()) != kind_.format)
    Fail(fmt::format("{} is none of format {}", kind_.about_file, kind_.format));
  const Json schema = about.value("schema", Json());
  if (!schema.is_number_integer() || schema > kSchemaVersion)
    Fail("it was made by a newer Plumb: install that one first");
  digest_ = Digest(kSumsFile, {}).sha256;
  if (about.value("sha256sums", Json()) != digest_)
    Fail(fmt::format("{} is not the one that was written", kSumsFile));
  const bool is_encrypted = about.contains(kEncryption);
  if (is_encrypted && secret == nullptr)
    Fail("it is encrypted: name the file of its key with --key-file");
  if (!is_encrypted && secret != nullptr)
    Fail("it is not encrypted, though a key file is named: leave that out if it is yours");
  if (is_encrypted) {
    try {
      cipher_ = std::make_unique<FileCipher>(*secret, about[kEncryption]);
    } catch (const DataError& error) {
      Fail(error.what());
    }
    if (about.value(kSignature, Json()) != cipher_->Signature(text))
      Fail(fmt::format("{} is not signed with the key", kSumsFile));
  }
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    begin = end + 1;
    constexpr std::size_t kHex = 64;
    if (line.size() < kHex + 3 || line.substr(kHex, 2) != "  " ||
        !IsPlainPath(line.substr(kHex + 2)) || !kind_.may_hold(line.substr(kHex + 2)))
      Fail(fmt::format("{} has a line that is none of a {}: {:?}", kSumsFile, kind_.name,
                       line.substr(0, 120)));
    files_.push_back({.path = line.substr(kHex + 2), .sha256 = line.substr(0, kHex)});
  }
  if (tar_ && tar_->entries().size() != files_.size() + 2)
    Fail(
        fmt::format("it has {} files, {} are expected", tar_->entries().size(), files_.size() + 2));
}

void SummedReader::OpenArchive() {
  std::error_code error;
  if (!fs::is_regular_file(folder_, error)) return;
  tar_ = std::make_unique<TarReader>(folder_);
  for (const auto& [path, entry] : tar_->entries()) {
    if (path != kSumsFile && path != kind_.about_file && !kind_.may_hold(path))
      throw DataError(fmt::format("{:?} in it is none of a {}", path.substr(0, 120), kind_.name));
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
  std::string first;
  for (const FileDigest& file : files_) {
    std::string why;
    try {
      if (Digest(file.path, stop).sha256 != file.sha256)
        why = file.path + " is not what was written";
    } catch (const IoError& error) {
      why = error.what();
    }
    if (why.empty()) continue;
    ++wrong;
    if (first.empty()) first = why;
  }
  if (wrong > 0) Fail(fmt::format("{} of {} files are damaged ({})", wrong, files_.size(), first));
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
    Fail(error.what());
  } catch (const DataError& error) {
    Fail(error.what());
  }
  if (read.sha256 != file.sha256) Fail(file.path + " changed while it was copied");
  return copy;
}

void SummedReader::Fail(const std::string& why) const {
  throw DataError(fmt::format("the {} {} cannot be used: {}; nothing was restored", kind_.name,
                              folder_.string(), why));
}

}  // namespace plumb

#include "daemon/records/summed_folder.hpp"

#include <sys/stat.h>

#include <algorithm>
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

constexpr const char* kSums = "SHA256SUMS";
constexpr const char* kEncryption = "encryption";
constexpr const char* kSignature = "signature";
constexpr std::size_t kMaxAbout = std::size_t{16} << 20, kMaxSums = std::size_t{512} << 20;
constexpr std::size_t kMaxProblems = 1000, kMaxPath = 4000;

}  // namespace

bool IsPlainPath(const std::string& path) {
  const bool has_control = std::any_of(
      path.begin(), path.end(), [](unsigned char c) { return c < 0x20 || c == 0x7F || c == '\\'; });
  if (has_control || path.empty() || path.size() > kMaxPath) return false;
  const fs::path parts(path);
  return parts.lexically_normal().string() == path &&
         std::none_of(parts.begin(), parts.end(), [](const fs::path& part) {
           return part.empty() || part == "." || part == ".." || part == "/";
         });
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
    throw IoError(fmt::format("cannot list {}: {}", folder.string(), error.message()));
  std::sort(files.begin(), files.end());
  return files;
}

SummedWriter::SummedWriter(const fs::path& target, const SummedKind& kind, OutputKind output,
                           const BackupSecret* secret, std::stop_token stop)
    : kind_(kind),
      output_(target, std::move(output)),
      cipher_(secret != nullptr ? std::make_unique<FileCipher>(*secret) : nullptr),
      stop_(std::move(stop)) {
  ::chmod(output_.path().c_str(), 0700);  // it contains patients' data
}

std::string SummedWriter::Copied(const fs::path& from, const std::string& path) {
  FileDigest plain, written;
  if (cipher_) {
    const FileCipher::Written both = cipher_->Seal(from, output_.path(), path, stop_);
    plain = both.plain;
    written = both.sealed;
  } else {
    plain = written = CloneOrCopy(from, output_.path(), path, stop_);
  }
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
  WriteWholeFile(output_.path() / kSums, std::string_view(sums_));
  about["format"] = kind_.format;
  about["schema"] = kSchemaVersion;
  about["made_at"] = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  about["files"] = files_;
  about["bytes"] = bytes_;
  about["sha256sums"] = DigestOfFile(output_.path(), kSums).sha256;
  about["problems"] = problems_;
  if (cipher_) {
    about[kEncryption] = cipher_->Header();
    about[kSignature] = cipher_->Signature(sums_);
  }
  WriteWholeFile(output_.path() / kind_.about_file,
                 about.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  output_.Commit();
}

SummedReader::SummedReader(fs::path folder, SummedKind kind, const BackupSecret* secret)
    : folder_(std::move(folder)), kind_(std::move(kind)) {
  Json about;
  std::string text;
  try {
    about = ParseBoundedJsonOrNothing<Json>(ReadTextFile(folder_ / kind_.about_file, kMaxAbout));
    text = ReadTextFile(folder_ / kSums, kMaxSums);
  } catch (const DataError& error) {
    Fail(error.what());
  }
  if (!about.is_object() || about.value("format", Json()) != kind_.format)
    Fail(fmt::format("{} is none of format {}", kind_.about_file, kind_.format));
  const Json schema = about.value("schema", Json());
  if (!schema.is_number_integer() || schema > kSchemaVersion)
    Fail("it was made by a newer Plumb: install that one first");
  digest_ = DigestOfFile(folder_, kSums).sha256;
  if (about.value("sha256sums", Json()) != digest_)
    Fail(fmt::format("{} is not the one that was written", kSums));
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
      Fail(fmt::format("{} is not signed with the key", kSums));
  }
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    begin = end + 1;
    constexpr std::size_t kHex = 64;
    if (line.size() < kHex + 3 || line.substr(kHex, 2) != "  " ||
        !IsPlainPath(line.substr(kHex + 2)) || !kind_.may_hold(line.substr(kHex + 2)))
      Fail(fmt::format("{} has a line that is none of a {}: {:?}", kSums, kind_.name,
                       line.substr(0, 120)));
    files_.push_back({.path = line.substr(kHex + 2), .sha256 = line.substr(0, kHex)});
  }
}

void SummedReader::Verify(const std::stop_token& stop) const {
  std::size_t wrong = 0;
  std::string first;
  for (const FileDigest& file : files_) {
    std::string why;
    try {
      if (DigestOfFile(folder_, file.path, stop).sha256 != file.sha256)
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
      const FileCipher::Written both = cipher_->Open(folder_, to, file.path, stop);
      copy = both.plain;
      read = both.sealed;
    } else {
      copy = read = Copy(folder_, to, file.path, stop);
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

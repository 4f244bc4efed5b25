// SPDX-License-Identifier: Apache-2.0
#include "daemon/sensor_profiles/profile_shelf.hpp"

#include <algorithm>
#include <cctype>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/files/sensor_profile_file.hpp"
#include "daemon/scan_files/scan_files.hpp"
#include "drivers/files/file_io.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::system_clock;
using Json = nlohmann::ordered_json;

constexpr const char* kHead = "plumb-profile-version 1 ";
constexpr const char* kEnding = ".profile";
constexpr const char* kRepeats = "repeats.json";
constexpr const char* kSetAside = "set-aside";
constexpr std::size_t kMaxProfileBytes = 1U << 20U;
constexpr int kMaxVersion = 999'999'999;

// Includes a plain serial itself, so that two serials never share a folder.
std::string FolderName(const std::string& serial) {
  constexpr std::size_t kLongest = 64;
  const auto is_plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_';
  };
  std::string name = serial.substr(0, kLongest);
  std::replace_if(
      name.begin(), name.end(), [&](char c) { return !is_plain(c); }, '_');
  if (name == serial && name != kSetAside) return name;
  return fmt::format("{}-{}", name, Sha256Of(serial).substr(0, 16));
}

// @throws DataError, nlohmann::json::exception
ProfileVersion Parse(const std::string& text, const std::string& serial, int version) {
  const std::size_t line = text.find('\n');
  const std::string_view head(kHead);
  if (line == std::string::npos || !text.starts_with(head))
    throw DataError(say::store::ProfileNoHead());
  const std::string body = text.substr(line + 1);
  if (text.substr(head.size(), line - head.size()) != Sha256Of(body))
    throw DataError(say::store::ProfileChecksum());
  const Json json = ParseBoundedJson<Json>(body);
  if (json.at("serial") != serial)
    throw DataError(say::store::ProfileOfOtherUnit(json.at("serial").dump()));
  ProfileVersion found;
  found.version = version;
  found.made = Clock::time_point(std::chrono::seconds(json.at("made_s").get<std::int64_t>()));
  const auto cause = Named<ProfileCause>(json.at("cause").get<std::string>());
  if (!cause) throw DataError(say::store::ProfileUnknownCause());
  found.cause = *cause;
  if (json.at("profile").is_null()) return found;
  found.profile = ParseSensorProfile(json["profile"].dump());
  found.profile->name = fmt::format("{} version {}", serial, version);
  return found;
}

ProfileVersion ReadVersion(const fs::path& file, const std::string& serial, int version) {
  try {
    return Parse(ReadTextFile(file, kMaxProfileBytes), serial, version);
  } catch (const nlohmann::json::exception& error) {
    throw DataError(error.what());
  }
}

}  // namespace

ProfileShelf::ProfileShelf(fs::path folder) : folder_(std::move(folder)) {}

fs::path ProfileShelf::FolderOf(const std::string& serial) const {
  if (serial.empty()) throw std::invalid_argument("a unit without a serial has no profile");
  return folder_ / FolderName(serial);
}

// Newest first. Files that are not named as versions are ignored.
std::vector<ProfileShelf::Entry> ProfileShelf::Entries(const std::string& serial) const {
  std::vector<Entry> entries;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(FolderOf(serial), error)) {
    const std::optional<int> version = ParseNumber<int>(entry.path().stem().string());
    if (entry.path().extension() == kEnding && version && *version > 0 && *version < kMaxVersion)
      entries.push_back({*version, entry.path()});
  }
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return a.version > b.version; });
  return entries;
}

ProfileShelf::InUse ProfileShelf::Read(const std::string& serial) {
  const std::lock_guard lock(mutex_);
  InUse in_use;
  const std::vector<Entry> entries = Entries(serial);
  if (entries.empty()) return in_use;
  const fs::path& file = entries.front().file;
  in_use.version = entries.front().version;
  try {
    in_use.newest = ReadVersion(file, serial, entries.front().version);
    return in_use;
  } catch (const DataError& error) {
    in_use.fault = say::store::ProfileUnreadable(serial, error.message());
  }
  try {
    // Comes first, so that no earlier version replaces it unnoticed at the next scan.
    in_use.version = Write(serial, ProfileCause::kUnreadable, std::nullopt);
    const fs::path set_aside =
        folder_ / kSetAside / fmt::format("{}-{}", FolderName(serial), file.filename().string());
    fs::create_directories(set_aside.parent_path());
    fs::rename(file, set_aside);
    in_use.fault = say::store::ProfileMoved(in_use.fault, set_aside.string());
  } catch (const std::exception& error) {
    in_use.fault = say::store::ProfileNotMoved(in_use.fault, MessageOf(error));
  }
  return in_use;
}

std::vector<ProfileVersion> ProfileShelf::Versions(const std::string& serial) const {
  const std::lock_guard lock(mutex_);
  std::vector<ProfileVersion> versions;
  for (const Entry& entry : Entries(serial)) {
    try {
      versions.push_back(ReadVersion(entry.file, serial, entry.version));
    } catch (const DataError&) {  // Read() reports the newest one
    }
  }
  return versions;
}

int ProfileShelf::Write(const std::string& serial, ProfileCause cause,
                        const std::optional<SensorProfile>& profile) {
  const std::vector<Entry> entries = Entries(serial);
  const int version = entries.empty() ? 1 : entries.front().version + 1;
  Json json;
  json["serial"] = serial;
  json["made_s"] =
      std::chrono::duration_cast<std::chrono::seconds>(Clock::now().time_since_epoch()).count();
  json["cause"] = Name(cause);
  json["profile"] = profile ? Json::parse(SensorProfileJson(*profile)) : Json();
  const std::string body = json.dump(1) + "\n";
  const fs::path folder = FolderOf(serial);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw IoError(DescribeWriteError(folder, error.value()));
  WriteFileAtomically(folder / fmt::format("{:06}{}", version, kEnding), [&](const fs::path& at) {
    WriteWholeFile(at, kHead + Sha256Of(body) + "\n" + body);
  });
  for (std::size_t i = kKeptVersions - 1; i < entries.size(); ++i)
    fs::remove(entries[i].file, error);
  return version;
}

int ProfileShelf::Add(const std::string& serial, const SensorProfile& profile,
                      std::optional<int> begun_from) {
  const std::lock_guard lock(mutex_);
  const std::vector<Entry> entries = Entries(serial);
  if (begun_from && (entries.empty() ? 0 : entries.front().version) != *begun_from)
    throw DataError(say::store::ProfileChanged());
  return Write(serial, ProfileCause::kLearned, profile);
}

int ProfileShelf::Reset(const std::string& serial) {
  const std::lock_guard lock(mutex_);
  return Write(serial, ProfileCause::kReset, std::nullopt);
}

void ProfileShelf::KeepRepeats(const std::string& serial, const std::string& json) {
  const std::lock_guard lock(mutex_);
  const fs::path folder = FolderOf(serial);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw IoError(DescribeWriteError(folder, error.value()));
  WriteFileAtomically(folder / kRepeats, [&](const fs::path& at) { WriteWholeFile(at, json); });
}

std::optional<std::string> ProfileShelf::Repeats(const std::string& serial) const {
  const std::lock_guard lock(mutex_);
  try {
    return ReadTextFile(FolderOf(serial) / kRepeats, kMaxProfileBytes);
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
}

int ProfileShelf::RollBack(const std::string& serial, int version) {
  const std::lock_guard lock(mutex_);
  for (const Entry& entry : Entries(serial)) {
    if (entry.version != version) continue;
    const ProfileVersion earlier = ReadVersion(entry.file, serial, version);
    if (!earlier.profile) break;
    return Write(serial, ProfileCause::kRolledBack, earlier.profile);
  }
  throw DataError(say::store::NoProfileVersion(serial, version));
}

}  // namespace plumb

// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/factory_reset.hpp"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <exception>
#include <sstream>
#include <system_error>
#include <vector>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "daemon/database/scan_folders.hpp"
#include "daemon/records/store.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "daemon/state_folder/old_copies.hpp"
#include "drivers/files/file_io.hpp"
#include "words/backup.hpp"
#include "words/upkeep.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxRequestBytes = 4096;
constexpr const char* kKeep = "keep_records";
constexpr const char* kWipe = "wipe";
constexpr const char* kOfFileSystem = "lost+found";  // root's, on the root of a disk
constexpr const char* kOfProvisionedDisplay = "provisioned-display";
/// Items beside the database that are neither records nor belong to the sensor.
constexpr std::array kOfPageAndUpdates = {"page-key.pem", "page-authority.pem",
                                          "device.key",   kOfProvisionedDisplay,
                                          "updates",      "channel.json"};

struct Request {
  FactoryReset kind = FactoryReset::kKeepRecords;
  Actor actor;
};

/// @throws DataError
Request ReadRequest(const fs::path& file) {
  const Json json = ParseBoundedJsonOrNothing(ReadTextFile(file, kMaxRequestBytes));
  try {
    const std::string kind = json.at("kind").get<std::string>();
    if (kind != kKeep && kind != kWipe)
      throw DataError(say::backup::ResetKind(kKeep, kWipe, kind.substr(0, 32)));
    return {.kind = kind == kWipe ? FactoryReset::kWipe : FactoryReset::kKeepRecords,
            .actor = {.user = json.at("user").get<std::string>(),
                      .address = json.at("address").get<std::string>()}};
  } catch (const std::exception& error) {
    throw DataError(say::backup::ResetUnreadable(file.string(), MessageOf(error)));
  }
}

void Remove(const fs::path& path) {
  std::error_code error;
  fs::remove_all(path, error);
  // The root of a mounted disk stays; its contents are removed.
  if (error && !(fs::is_directory(path) && fs::is_empty(path)))
    throw DiskRefused(say::backup::ResetNotRemoved(path.string(), error.message()));
}

std::vector<fs::path> EntriesOf(const fs::path& folder) {
  std::vector<fs::path> entries;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    entries.push_back(entry.path());
  return entries;
}

/// The files of scans are removed before the database, so that an interrupted wipe never looks like
/// a lost database. What cannot be removed does not keep the rest from
/// being removed.
/// @throws DiskRefused at the end, for the first that could not be removed
void Wipe(const fs::path& state) {
  FolderLock lock;
  lock.Take(state);
  std::exception_ptr first;
  const auto remove = [&first](const fs::path& path) {
    try {
      Remove(path);
    } catch (const DiskRefused&) {
      if (!first) first = std::current_exception();
    }
  };
  const fs::path scans = state / kScansFolder;
  if (fs::is_directory(scans)) {  // or a link to one, on another disk
    for (const fs::path& entry : EntriesOf(scans)) {
      if (entry.filename() != kOfFileSystem) remove(entry);
    }
    std::error_code kept;  // it stays where it is the root of a disk
    fs::remove(scans, kept);
  } else if (fs::is_symlink(scans)) {
    throw DiskRefused(say::backup::ResetNoDisk(scans.string()));
  } else {
    remove(scans);
  }
  for (const fs::path& entry : EntriesOf(state)) {
    if (entry != scans && entry.filename() != kFactoryResetFile &&
        entry.filename() != kFactoryResetLeft && entry.filename() != kOfFileSystem)
      remove(entry);
  }
  SyncToDisk(state);
  if (first) std::rethrow_exception(first);
}

/// Of what plumbd may not remove itself. @throws DiskRefused
void RequireNothingLeftOutside(const fs::path& state) {
  const fs::path note = state / kFactoryResetLeft;
  std::error_code error;
  if (!fs::exists(fs::symlink_status(note, error))) return;
  std::istringstream lines(ReadTextFile(note, kMaxRequestBytes));
  std::string what, why;
  std::getline(lines, what);
  std::getline(lines, why);
  throw DiskRefused(say::backup::ResetNotRemoved(what, why));
}

/// With its entry in the log; a store that cannot be opened is not changed.
Message KeepRecords(const fs::path& state, const Actor& actor) {
  Message done;
  {
    Store store(state);
    StoreChange change(store.database());
    change->Run("DELETE FROM users");
    done = say::backup::ResetKept(change->num_changed());
    change->Run("DELETE FROM displays");
    change->Run("DELETE FROM settings WHERE name = 'settings'");
    change.Log(actor, "system.factory_reset", "", done);
    change.Commit();
  }
  for (const fs::path& copy : OldCopies(state)) {
    RemoveAccountsFromCopy(copy);
    Remove(copy / kOfProvisionedDisplay);  // the hash of its key
  }
  // Nobody can look for accounts in these, and the records in use have just been opened.
  for (const fs::path& entry : EntriesOf(state))
    if (entry.filename().string().starts_with(kDamagedPrefix)) Remove(entry);
  for (const char* name : kOfPageAndUpdates) Remove(state / name);
  return done;
}

/// @throws IoError
void RemoveRequest(const fs::path& state) {
  if (::unlink((state / kFactoryResetFile).c_str()) == 0) return SyncToDisk(state);
  if (errno != ENOENT) throw IoError(DescribeWriteError(state / kFactoryResetFile, errno));
}

}  // namespace

void RequestFactoryReset(const fs::path& state, FactoryReset kind, const Actor& actor) {
  const Json json = {{"kind", kind == FactoryReset::kWipe ? kWipe : kKeep},
                     {"user", actor.user},
                     {"address", actor.address}};
  try {
    PlaceFile(state, kFactoryResetFile, json.dump(-1, ' ', false, Json::error_handler_t::replace));
  } catch (const std::exception& error) {
    throw IoError(CancelFactoryReset(state, MessageOf(error)));
  }
}

Message CancelFactoryReset(const fs::path& state, Message what) {
  try {
    RemoveRequest(state);
    return what;
  } catch (const std::exception& error) {
    return say::upkeep::ResetMayHappen(what, MessageOf(error));
  }
}

std::optional<Message> CarryOutFactoryReset(const fs::path& state) {
  const fs::path file = state / kFactoryResetFile;
  std::error_code error;
  if (!fs::exists(fs::symlink_status(file, error))) return std::nullopt;
  const Request request = ReadRequest(file);
  Message done = say::backup::ResetWiped();
  if (request.kind == FactoryReset::kWipe) {
    Wipe(state);
    RequireNothingLeftOutside(state);
    Store(state).audit.Log(request.actor, "system.factory_reset", "", done);
  } else {
    done = KeepRecords(state, request.actor);
  }
  RemoveRequest(state);
  return done;
}

}  // namespace plumb

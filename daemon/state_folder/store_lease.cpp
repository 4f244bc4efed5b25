// SPDX-License-Identifier: Apache-2.0
#include "daemon/state_folder/store_lease.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <optional>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "daemon/database/database.hpp"
#include "drivers/files/file_io.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::chrono::minutes kLeaseTime{10};

std::string FirstLineOf(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

/// Nothing if there is none, or it is damaged, as by a power cut.
std::optional<LeaseHolder> HolderIn(const fs::path& file) {
  constexpr std::size_t kLongest = 4096;
  try {
    const Json json = ParseBoundedJsonOrNothing<Json>(ReadTextFile(file, kLongest));
    return LeaseHolder{.host = json.at("host").get<std::string>(),
                       .machine = json.at("machine").get<std::string>(),
                       .boot = json.at("boot").get<std::string>(),
                       .process = json.at("process").get<long>()};
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

/// The file's time may be by this machine's clock or by a server's, so a time in the future counts
/// like one in the past.
bool IsRecent(const fs::path& file) {
  std::error_code error;
  const auto age = fs::file_time_type::clock::now() - fs::last_write_time(file, error);
  return !error && std::chrono::abs(age) < kLeaseTime;
}

/// Not for a lease of this machine, where the lock of the folder decides. Without /etc/machine-id,
/// two machines are distinguished by their host names.
bool IsOfAnotherMachine(const LeaseHolder& holder) {
  const LeaseHolder self = ThisProcess();
  if (holder.boot == self.boot) return false;
  return holder.machine != self.machine || (holder.machine.empty() && holder.host != self.host);
}

}  // namespace

LeaseHolder ThisProcess() {
  std::array<char, 256> host{};
  (void)::gethostname(host.data(), host.size() - 1);
  return {.host = host.data(),
          .machine = FirstLineOf("/etc/machine-id"),
          .boot = FirstLineOf("/proc/sys/kernel/random/boot_id"),
          .process = ::getpid()};
}

Message WhyNoPlaceForStore(const fs::path& folder, unsigned long kind) {
  constexpr std::array<std::pair<unsigned long, std::string_view>, 9> kShared = {{
      {0x6969, "NFS"},
      {0x517B, "SMB"},
      {0xFF534D42, "CIFS"},
      {0xFE534D42, "SMB2"},
      {0x5346414F, "AFS"},
      {0x6B414653, "AFS"},
      {0x00C36400, "Ceph"},
      {0x73757245, "Coda"},
      {0x564C, "NCP"},
  }};
  for (const auto& [number, name] : kShared) {
    if (kind == number) return say::store::SharedDisk(folder.string(), std::string(name));
  }
  return {};
}

StoreLease::~StoreLease() {
  if (!file_.empty() && HolderIn(file_) == ThisProcess()) ::unlink(file_.c_str());
}

void StoreLease::Take(const fs::path& folder) {
  const fs::path file = folder / kLeaseFile;
  if (const std::optional<LeaseHolder> holder = HolderIn(file);
      holder && IsOfAnotherMachine(*holder) && IsRecent(file))
    throw DatabaseBusy(say::store::FolderLeased(folder.string(), holder->process, holder->host));
  file_ = file;
  Renew();
}

void StoreLease::Renew() {
  if (file_.empty()) return;
  const LeaseHolder self = ThisProcess();
  const std::string text = Json{
      {"host", self.host},
      {"machine", self.machine},
      {"boot", self.boot},
      {"process",
       self.process}}.dump(-1, ' ', false, Json::error_handler_t::replace);
  const int fd = ::open(file_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0640);
  if (fd < 0) return;
  // Less than a sector, in one call: it is never half written.
  if (::pwrite(fd, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size()))
    (void)!::ftruncate(fd, static_cast<off_t>(text.size()));
  ::close(fd);
}

}  // namespace plumb

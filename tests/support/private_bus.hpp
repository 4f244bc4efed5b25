// SPDX-License-Identifier: Apache-2.0
// A message bus that only one test knows.
#pragma once

#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

extern char** environ;

namespace plumb::testing {

namespace fs = std::filesystem;

/// A dbus-daemon that only this test knows. Ends with it.
class PrivateBus {
 public:
  /// @throws std::runtime_error if the bus does not answer within ten seconds.
  explicit PrivateBus(const fs::path& folder) : address_("unix:path=" + (folder / "bus").string()) {
    const fs::path config = folder / "bus.conf";
    std::ofstream(config)
        << R"(<!DOCTYPE busconfig PUBLIC "-//freedesktop//DTD D-BUS Bus Configuration 1.0//EN"
 "http://www.freedesktop.org/standards/dbus/1.0/busconfig.dtd"><busconfig><type>session</type><listen>)"
        << address_ << R"(</listen><auth>EXTERNAL</auth><policy context="default"><allow user="*"/>
<allow send_destination="*" eavesdrop="true"/><allow eavesdrop="true"/><allow own="*"/></policy></busconfig>)";
    std::string file = "--config-file=" + config.string();
    std::string program = "dbus-daemon", nofork = "--nofork";
    char* arguments[] = {program.data(), nofork.data(), file.data(), nullptr};
    if (::posix_spawnp(&pid_, "dbus-daemon", nullptr, nullptr, arguments, environ) != 0)
      throw std::runtime_error("dbus-daemon cannot be started");
    for (int i = 0; i < 2000; ++i) {
      if (Answers(folder / "bus")) return;
      ::usleep(5000);
    }
    Stop();
    throw std::runtime_error("dbus-daemon does not answer at " + address_);
  }
  ~PrivateBus() { Stop(); }
  void Stop() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);  // it has inherited that the loop blocks SIGTERM
    ::waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }
  [[nodiscard]] const std::string& address() const { return address_; }

 private:
  /// The socket's file exists a moment before anybody listens.
  [[nodiscard]] static bool Answers(const fs::path& socket_file) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    socket_file.string().copy(address.sun_path, sizeof address.sun_path - 1);
    const int socket = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (socket < 0) return false;
    const bool answers =
        ::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    ::close(socket);
    return answers;
  }

  std::string address_;
  pid_t pid_ = -1;
};

}  // namespace plumb::testing

// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/openni/virtual_session.hpp"

#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/program_folders.hpp"
#include "drivers/simulator/player/virtual_scenes.hpp"
#include "words/simulator.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr char kEnvironment[] = "PLUMB_VIRTUAL_SENSOR";
constexpr std::chrono::seconds kAnswerTime{1};

/// A socket for the answers.
class AnswerSocket {
 public:
  AnswerSocket() : descriptor_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;  // Without a name, so that the kernel chooses one.
    if (descriptor_ < 0 ||
        ::bind(descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof(sa_family_t)) != 0)
      throw DeviceError(say::simulator::NoSocket(std::strerror(errno)));
  }
  ~AnswerSocket() { ::close(descriptor_); }
  AnswerSocket(const AnswerSocket&) = delete;
  AnswerSocket& operator=(const AnswerSocket&) = delete;
  [[nodiscard]] int get() const { return descriptor_; }

 private:
  int descriptor_;
};

}  // namespace

fs::path FindVirtualSensorRuntime() {
  const std::optional<fs::path> found =
      FindBesideProgram("lib/plumb/virtual-sensor/libOpenNI2.so.0");
  if (!found) throw IoError(say::simulator::DriverMissing());
  return *found;
}

VirtualSession::VirtualSession(const Contents& contents)
    : folder_(fs::temp_directory_path(), "plumb-virtual-"),
      calibration_folder_(folder_.path() / "calibration"),
      socket_(folder_.path() / "sensor.sock") {
  const auto is_plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_';
  };
  if (contents.serial.empty() || contents.serial.size() > 64 ||
      !std::all_of(contents.serial.begin(), contents.serial.end(), is_plain))
    throw std::invalid_argument("a virtual sensor's serial is 1 to 64 letters, digits, - and _");
  Write(contents);
  ::setenv(kEnvironment, folder_.path().c_str(), 1);
}

VirtualSession::~VirtualSession() { ::unsetenv(kEnvironment); }

void VirtualSession::Write(const Contents& contents) const {
  std::error_code error;
  fs::create_directory(calibration_folder_, error);
  if (error) throw IoError(DescribeWriteError(calibration_folder_, error.value()));
  std::string text =
      fmt::format("serial {}\nplugged {}\n", contents.serial, contents.plugged ? 1 : 0);
  for (const fs::path& scene : contents.scenes)
    text += fmt::format("scene {}\n", fs::absolute(scene).string());
  WriteWholeFile(folder_.path() / "session", text);
  WriteWholeFile(calibration_folder_ / (contents.serial + ".yaml"), contents.camera_file);
}

std::string VirtualSession::Command(std::string_view command) const {
  const AnswerSocket answers;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = socket_.string();
  if (path.size() >= sizeof address.sun_path) throw DeviceError(say::simulator::SocketPath(path));
  std::memcpy(address.sun_path, path.data(), path.size());
  if (::sendto(answers.get(), command.data(), command.size(), 0,
               reinterpret_cast<const sockaddr*>(&address), sizeof address) < 0)
    throw DeviceError(say::simulator::NotListening(std::strerror(errno)));
  pollfd wait{answers.get(), POLLIN, 0};
  const int ready =
      ::poll(&wait, 1, static_cast<int>(std::chrono::milliseconds(kAnswerTime).count()));
  std::array<char, 512> buffer{};
  const ssize_t size = ready > 0 ? ::recv(answers.get(), buffer.data(), buffer.size(), 0) : -1;
  if (size < 0) throw DeviceError(say::simulator::NoAnswer(command, kAnswerTime.count()));
  return AcceptedAnswer(command, std::string(buffer.data(), static_cast<std::size_t>(size)));
}

}  // namespace plumb

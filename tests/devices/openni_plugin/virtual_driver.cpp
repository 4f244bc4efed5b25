// SPDX-License-Identifier: Apache-2.0
// The driver that OpenNI2 loads: virtual units that are plugged in and unplugged by command. Its
// session is described in the file `session` of the folder named by $PLUMB_VIRTUAL_SENSOR (lines
// `serial S`, `plugged 0|1`, `scene FILE`); it listens on `sensor.sock` there.
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <thread>

#include "drivers/simulator/player/virtual_bus.hpp"
#include "tests/devices/openni_plugin/oni_driver.hpp"
#include "tests/devices/openni_plugin/virtual_device.hpp"

namespace plumb::simulated {
namespace {

constexpr std::size_t kMaxCommand = 256;

struct Session {
  std::string serial = "VIRTUAL-0001";
  bool plugged = true;
  std::vector<std::string> scenes;
};

Session ReadSession(const std::string& folder) {
  Session session;
  std::ifstream file(folder + "/session");
  for (std::string line; std::getline(file, line);) {
    const std::size_t space = line.find(' ');
    if (space == std::string::npos) continue;
    const std::string key = line.substr(0, space), value = line.substr(space + 1);
    if (key == "serial") session.serial = value;
    if (key == "plugged") session.plugged = value == "1";
    if (key == "scene") session.scenes.push_back(value);
  }
  return session;
}

OniDeviceInfo InfoOf(const Unit& unit) {
  OniDeviceInfo info{};
  std::strncpy(info.uri, unit.uri.c_str(), sizeof info.uri - 1);
  std::strncpy(info.vendor, "Plumb", sizeof info.vendor - 1);
  std::strncpy(info.name, "Virtual Xtion", sizeof info.name - 1);
  info.usbVendorId = kVirtualUsbVendor;
  info.usbProductId = kVirtualUsbProduct;
  return info;
}

class VirtualDriver : public oni::driver::DriverBase {
 public:
  explicit VirtualDriver(OniDriverServices* services) : DriverBase(services) {}

  OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                       oni::driver::DeviceDisconnectedCallback disconnected,
                       oni::driver::DeviceStateChangedCallback changed, void* cookie) override {
    DriverBase::initialize(connected, disconnected, changed, cookie);
    const char* folder = std::getenv("PLUMB_VIRTUAL_SENSOR");
    if (folder == nullptr) return ONI_STATUS_ERROR;
    try {
      const Session session = ReadSession(folder);
      bus_ = std::make_unique<VirtualBus>(std::make_shared<Stage>(session.scenes), session.serial);
      bus_->SetListener([this](const Unit& unit, VirtualBus::Event event) { Pass(unit, event); });
      Listen(std::string(folder) + "/sensor.sock");
      if (session.plugged) (void)bus_->Obey("plug");
    } catch (const std::exception& error) {
      getServices().errorLoggerAppend("virtual sensor: %s", error.what());
      return ONI_STATUS_ERROR;
    }
    return ONI_STATUS_OK;
  }

  void shutdown() override {
    while (bus_ && bus_->hangs()) ::pause();
    if (thread_.joinable()) {
      ::eventfd_write(stop_, 1);
      thread_.join();
    }
    for (int* descriptor : {&socket_, &stop_}) {
      if (*descriptor >= 0) ::close(*descriptor);
      *descriptor = -1;
    }
    if (!path_.empty()) ::unlink(path_.c_str());
  }

  ~VirtualDriver() override = default;

  OniStatus tryDevice(const char*) override { return ONI_STATUS_ERROR; }

  oni::driver::DeviceBase* deviceOpen(const char* uri, const char*) override {
    const std::shared_ptr<Unit> unit = bus_->At(uri);
    return unit ? new VirtualDevice(unit, bus_->stage()) : nullptr;
  }
  void deviceClose(oni::driver::DeviceBase* device) override { delete device; }

  // The streams of a unit are always synchronous.
  void* enableFrameSync(oni::driver::StreamBase**, int) override { return this; }
  void disableFrameSync(void*) override {}

 private:
  void Listen(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.size() >= sizeof address.sun_path)
      throw std::runtime_error("path of the socket is too long: " + path);
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    stop_ = ::eventfd(0, EFD_CLOEXEC);
    ::unlink(path.c_str());
    if (socket_ < 0 || stop_ < 0 ||
        ::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      throw std::runtime_error("cannot listen on " + path + ": " + std::strerror(errno));
    path_ = path;
    thread_ = std::thread([this] { Serve(); });
  }

  void Serve() {
    for (;;) {
      std::array<pollfd, 2> waits{{{socket_, POLLIN, 0}, {stop_, POLLIN, 0}}};
      if (::poll(waits.data(), waits.size(), -1) < 0 && errno != EINTR) return;
      if (waits[1].revents != 0) return;
      if (waits[0].revents == 0) continue;
      std::array<char, kMaxCommand> buffer{};
      sockaddr_un sender{};
      socklen_t length = sizeof sender;
      const ssize_t size = ::recvfrom(socket_, buffer.data(), buffer.size(), 0,
                                      reinterpret_cast<sockaddr*>(&sender), &length);
      if (size <= 0) continue;
      const std::string command(buffer.data(), static_cast<std::size_t>(size));
      const bool quits = command == "quit";
      const std::string answer = quits ? "ok" : bus_->Obey(command);
      if (length > sizeof(sa_family_t))
        ::sendto(socket_, answer.data(), answer.size(), MSG_DONTWAIT,
                 reinterpret_cast<const sockaddr*>(&sender), length);
      if (quits) return;
    }
  }

  void Pass(const Unit& unit, VirtualBus::Event event) {
    const OniDeviceInfo info = InfoOf(unit);
    switch (event) {
      case VirtualBus::Event::kPlugged:
        deviceConnected(&info);
        return;
      case VirtualBus::Event::kUnplugged:
        deviceStateChanged(&info, ONI_DEVICE_STATE_NOT_READY);
        deviceDisconnected(&info);
        return;
      case VirtualBus::Event::kFailed:
        deviceStateChanged(&info, ONI_DEVICE_STATE_ERROR);
        return;
      case VirtualBus::Event::kWorksAgain:
        deviceStateChanged(&info, ONI_DEVICE_STATE_OK);
        return;
    }
  }

  std::unique_ptr<VirtualBus> bus_;
  std::string path_;
  int socket_ = -1;
  int stop_ = -1;
  std::thread thread_;
};

}  // namespace
}  // namespace plumb::simulated

using PlumbVirtualDriver = plumb::simulated::VirtualDriver;
ONI_EXPORT_DRIVER(PlumbVirtualDriver)

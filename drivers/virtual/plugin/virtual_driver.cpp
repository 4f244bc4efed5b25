// The driver that OpenNI2 loads: virtual units that come and go by command. What it plays stands in
// the file `session` of the folder that $PLUMB_VIRTUAL_SENSOR names (lines `serial S`, `plugged
// 0|1`, `scene FILE`); it listens on `sensor.sock` there.
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <fstream>
#include <list>
#include <sstream>

#include "drivers/virtual/plugin/oni_driver.hpp"
#include "drivers/virtual/plugin/stage.hpp"
#include "drivers/virtual/plugin/virtual_device.hpp"

namespace plumb::simulated {
namespace {

constexpr std::uint16_t kUsbVendor = 0x1d27;
constexpr std::uint16_t kUsbProduct = 0x0601;  // Xtion Pro Live
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
  info.usbVendorId = kUsbVendor;
  info.usbProductId = kUsbProduct;
  return info;
}

/// @throws std::invalid_argument for an unknown name.
Glitch ParseGlitch(const std::string& name) {
  if (name == "late") return Glitch::kLate;
  if (name == "double") return Glitch::kDouble;
  if (name == "old") return Glitch::kOld;
  if (name == "size") return Glitch::kSize;
  if (name == "lone") return Glitch::kLone;
  throw std::invalid_argument("unknown glitch " + name);
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
      stage_ = std::make_shared<Stage>(session.scenes);
      default_serial_ = session.serial;
      Listen(std::string(folder) + "/sensor.sock");
      if (session.plugged) Plug(session.serial);
    } catch (const std::exception& error) {
      getServices().errorLoggerAppend("virtual sensor: %s", error.what());
      return ONI_STATUS_ERROR;
    }
    return ONI_STATUS_OK;
  }

  void shutdown() override {
    while (hangs_) ::pause();
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
    const std::lock_guard lock(mutex_);
    for (const auto& unit : units_) {
      if (unit->uri == uri) return new VirtualDevice(unit, stage_);
    }
    return nullptr;
  }
  void deviceClose(oni::driver::DeviceBase* device) override { delete device; }

  // The streams of a unit are in step anyway.
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
      const std::string answer = quits ? "ok" : Obey(command);
      if (length > sizeof(sa_family_t))
        ::sendto(socket_, answer.data(), answer.size(), MSG_DONTWAIT,
                 reinterpret_cast<const sockaddr*>(&sender), length);
      if (quits) return;
    }
  }

  std::string Obey(const std::string& line) try {
    std::istringstream words(line);
    std::string verb, argument;
    words >> verb >> argument;
    if (verb == "plug") return Plug(argument.empty() ? default_serial_ : argument);
    if (verb == "next-scene") return Show(stage_->Now().index + 1, Stage::Motion::kStill);
    if (verb == "scene") return Show(std::stoul(argument), Stage::Motion::kStill);
    if (verb == "rewind") {
      std::int64_t origin_us = -1;
      words >> origin_us;
      return Show(stage_->Now().index,
                  argument == "once" ? Stage::Motion::kSweepOnce : Stage::Motion::kSweep,
                  words ? origin_us : -1);
    }
    if (verb == "hold") return Show(stage_->Now().index, Stage::Motion::kStill);
    if (verb == "state") return State();
    if (verb == "speed") {
      const double speed = std::stod(argument);
      if (!(speed >= 0 && speed <= 1000)) return "refused: speed must be 0 to 1000";
      stage_->SetSpeed(speed);
      return "ok";
    }
    if (verb == "glitch") {
      int count = 1;
      if (!(words >> count)) count = 1;
      return OnUnit("", [&, glitch = ParseGlitch(argument)](Unit& unit) {
        unit.glitch = glitch;
        unit.glitches_left = std::clamp(count, 0, 10000);
      });
    }
    if (verb == "hang") {
      hangs_ = true;
      return "ok";
    }
    if (verb == "unplug") return Unplug(argument);
    if (verb == "stall") return OnUnit(argument, [](Unit& unit) { unit.stalled = true; });
    if (verb == "error") return Report(argument, true);
    if (verb == "resume") return Report(argument, false);
    return "refused: unknown command " + verb;
  } catch (const std::exception&) {
    return "refused: cannot understand the argument of " + line;
  }

  std::string Show(std::size_t scene, Stage::Motion motion, std::int64_t origin_us = -1) {
    stage_->Show(scene, motion, origin_us);
    return "ok";
  }

  std::string State() {
    const Stage::View view = stage_->Now();
    std::ostringstream text;
    text << "ok scene=" << view.index << " scenes=" << stage_->size()
         << " frames=" << view.scene->shape().num_frames;
    const std::lock_guard lock(mutex_);
    for (const auto& unit : units_)
      text << " unit=" << unit->serial << " position=" << unit->position;
    return text.str();
  }

  // Callbacks go out without the lock: listeners may open or close a unit from them.
  std::string Plug(const std::string& serial) {
    OniDeviceInfo info{};
    {
      const std::lock_guard lock(mutex_);
      if (Find(serial)) return "ok already plugged";
      auto unit = std::make_shared<Unit>();
      unit->serial = serial;
      unit->uri = "plumb-virtual/" + std::to_string(++num_plugs_);
      units_.push_back(unit);
      info = InfoOf(*unit);
    }
    deviceConnected(&info);
    return "ok";
  }

  std::string Unplug(const std::string& serial) {
    std::shared_ptr<Unit> unit;
    {
      const std::lock_guard lock(mutex_);
      unit = Find(serial);
      if (!unit) return "ok not plugged";
      units_.remove(unit);
    }
    unit->gone = true;
    const OniDeviceInfo info = InfoOf(*unit);
    deviceStateChanged(&info, ONI_DEVICE_STATE_NOT_READY);
    deviceDisconnected(&info);
    return "ok";
  }

  std::string Report(const std::string& serial, bool failed) {
    OniDeviceInfo info{};
    const std::string answer = OnUnit(serial, [&](Unit& unit) {
      unit.failed = failed;
      if (!failed) unit.stalled = false;
      info = InfoOf(unit);
    });
    if (answer == "ok")
      deviceStateChanged(&info, failed ? ONI_DEVICE_STATE_ERROR : ONI_DEVICE_STATE_OK);
    return answer;
  }

  template <typename Change>
  std::string OnUnit(const std::string& serial, Change&& change) {
    const std::lock_guard lock(mutex_);
    const std::shared_ptr<Unit> unit = Find(serial);
    if (!unit) return "refused: no such unit is plugged";
    change(*unit);
    return "ok";
  }

  // Needs the lock. Empty: the unit that was plugged first.
  std::shared_ptr<Unit> Find(const std::string& serial) {
    const auto found = std::find_if(units_.begin(), units_.end(), [&](const auto& unit) {
      return serial.empty() || unit->serial == serial;
    });
    return found == units_.end() ? nullptr : *found;
  }

  std::shared_ptr<Stage> stage_;
  std::string default_serial_;
  std::mutex mutex_;
  std::list<std::shared_ptr<Unit>> units_;
  int num_plugs_ = 0;
  std::string path_;
  int socket_ = -1;
  int stop_ = -1;
  std::thread thread_;
  std::atomic<bool> hangs_ = false;
};

}  // namespace
}  // namespace plumb::simulated

using PlumbVirtualDriver = plumb::simulated::VirtualDriver;
ONI_EXPORT_DRIVER(PlumbVirtualDriver)

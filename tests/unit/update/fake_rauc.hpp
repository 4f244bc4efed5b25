// SPDX-License-Identifier: Apache-2.0
// A RAUC of the tests' own, on a bus of their own.
#pragma once

#include <systemd/sd-bus.h>

#include <atomic>
#include <mutex>
#include <string>
#include <thread>

namespace plumb::testing {

/// As much of RAUC 1.8 as the updater speaks with: names, signatures and order of signals are
/// RAUC's.
class FakeRauc {
 public:
  std::atomic<bool> refuses_signature{false};
  std::atomic<bool> fails{false};
  std::atomic<bool> is_silent{false};  ///< Takes questions about bundles and never answers.
  std::atomic<int> num_asked{0};       ///< Questions about bundles.
  std::string version = "9.0", slot = "A";
  std::atomic<int> first_percent{40};
  std::atomic<const char*> first_step{"Copying image to rootfs.1"};

  explicit FakeRauc(const std::string& address) {
    sd_bus_new(&bus_);
    sd_bus_set_address(bus_, address.c_str());
    sd_bus_set_bus_client(bus_, 1);
    sd_bus_start(bus_);
    sd_bus_add_object_vtable(bus_, nullptr, "/", "de.pengutronix.rauc.Installer", kTable, this);
    sd_bus_request_name(bus_, "de.pengutronix.rauc", 0);
    thread_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        if (sd_bus_process(bus_, nullptr) == 0) sd_bus_wait(bus_, 20000);
        if (const int percent = reach_.exchange(-1); percent >= 0) {
          percent_ = percent;
          sd_bus_emit_properties_changed(bus_, "/", "de.pengutronix.rauc.Installer", "Progress",
                                         nullptr);
        }
        if (release_.exchange(false)) Finish();
      }
    });
  }
  ~FakeRauc() {
    thread_.request_stop();
    thread_.join();
    sd_bus_flush_close_unref(bus_);
  }
  /// The installation that waits goes on to its end.
  void Release() { release_ = true; }
  /// The installation that waits comes so far.
  void Reach(int percent) { reach_ = percent; }
  [[nodiscard]] std::string installed() const {
    const std::lock_guard lock(mutex_);
    return installed_;
  }

 private:
  static int Info(sd_bus_message* message, void* self, sd_bus_error* error) {
    auto* rauc = static_cast<FakeRauc*>(self);
    ++rauc->num_asked;
    if (rauc->is_silent) return 1;
    if (rauc->refuses_signature)
      return sd_bus_error_set(error, "org.gtk.GDBus.UnmappedGError.Quark._r_2dbundle",
                              "signature verification failed");
    rauc->Report(0, "Checking bundle");
    rauc->Report(100, "Checking bundle done.");
    return sd_bus_reply_method_return(message, "ss", "plumb-amd64", rauc->version.c_str());
  }
  static int Install(sd_bus_message* message, void* self, sd_bus_error*) {
    auto* rauc = static_cast<FakeRauc*>(self);
    const char* path = nullptr;
    sd_bus_message_read(message, "s", &path);
    {
      const std::lock_guard lock(rauc->mutex_);
      rauc->installed_ = path;
    }
    sd_bus_reply_method_return(message, "");
    rauc->operation_ = "installing";
    rauc->percent_ = rauc->first_percent;
    rauc->text_ = rauc->first_step;
    sd_bus_emit_properties_changed(rauc->bus_, "/", "de.pengutronix.rauc.Installer", "Operation",
                                   "Progress", nullptr);
    return 1;
  }
  void Report(int percent, const char* step) {
    percent_ = percent;
    text_ = step;
    sd_bus_emit_properties_changed(bus_, "/", "de.pengutronix.rauc.Installer", "Progress", nullptr);
  }
  void Finish() {
    percent_ = 100;
    text_ = fails ? "Installing failed." : "Installing done.";
    last_error_ = fails ? "Failed writing to the slot" : "";
    operation_ = "idle";
    sd_bus_emit_properties_changed(bus_, "/", "de.pengutronix.rauc.Installer", "Progress",
                                   "LastError", "Operation", nullptr);
    sd_bus_emit_signal(bus_, "/", "de.pengutronix.rauc.Installer", "Completed", "i", fails ? 1 : 0);
  }
  static int Progress(sd_bus*, const char*, const char*, const char*, sd_bus_message* reply,
                      void* self, sd_bus_error*) {
    const auto* rauc = static_cast<FakeRauc*>(self);
    return sd_bus_message_append(reply, "(isi)", rauc->percent_, rauc->text_, 1);
  }
  static int Text(sd_bus*, const char*, const char*, const char* name, sd_bus_message* reply,
                  void* self, sd_bus_error*) {
    const auto* rauc = static_cast<FakeRauc*>(self);
    const std::string property = name;
    return sd_bus_message_append(reply, "s",
                                 property == "Operation"   ? rauc->operation_
                                 : property == "LastError" ? rauc->last_error_
                                 : property == "BootSlot"  ? rauc->slot.c_str()
                                                           : "plumb-amd64");
  }

  static inline const sd_bus_vtable kTable[] = {
      SD_BUS_VTABLE_START(0),
      SD_BUS_METHOD("Info", "s", "ss", &FakeRauc::Info, SD_BUS_VTABLE_UNPRIVILEGED),
      SD_BUS_METHOD("InstallBundle", "sa{sv}", "", &FakeRauc::Install, SD_BUS_VTABLE_UNPRIVILEGED),
      SD_BUS_PROPERTY("Operation", "s", &FakeRauc::Text, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
      SD_BUS_PROPERTY("LastError", "s", &FakeRauc::Text, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
      SD_BUS_PROPERTY("Progress", "(isi)", &FakeRauc::Progress, 0,
                      SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
      SD_BUS_PROPERTY("Compatible", "s", &FakeRauc::Text, 0, 0),
      SD_BUS_PROPERTY("BootSlot", "s", &FakeRauc::Text, 0, 0),
      SD_BUS_SIGNAL("Completed", "i", 0),
      SD_BUS_VTABLE_END};

  sd_bus* bus_ = nullptr;
  const char *operation_ = "idle", *last_error_ = "", *text_ = "";
  int percent_ = 0;
  std::atomic<bool> release_{false};
  std::atomic<int> reach_{-1};
  mutable std::mutex mutex_;
  std::string installed_;
  std::jthread thread_;
};

}  // namespace plumb::testing

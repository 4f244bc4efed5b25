// SPDX-License-Identifier: Apache-2.0
// A service of the test's own on its private bus.
#pragma once

#include <systemd/sd-bus.h>

#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>

namespace plumb::testing {

/// Answers on a thread of its own, from its construction to its destruction.
class BusService {
 public:
  struct Object {
    const char* name;  ///< Of the service.
    const char* path;
    const char* interface;
    const sd_bus_vtable* table;
    void* self;  ///< For the functions of the table.
  };

  /// @throws std::runtime_error if it cannot be had on this bus.
  BusService(const std::string& address, const Object& object) {
    const bool is_there = sd_bus_new(&bus_) >= 0 &&
                          sd_bus_set_address(bus_, address.c_str()) >= 0 &&
                          sd_bus_set_bus_client(bus_, 1) >= 0 && sd_bus_start(bus_) >= 0 &&
                          sd_bus_add_object_vtable(bus_, nullptr, object.path, object.interface,
                                                   object.table, object.self) >= 0 &&
                          sd_bus_request_name(bus_, object.name, 0) >= 0;
    if (!is_there) {
      sd_bus_unref(bus_);
      throw std::runtime_error(std::string("no bus for ") + object.name);
    }
    thread_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        if (sd_bus_process(bus_, nullptr) == 0) sd_bus_wait(bus_, 20000);
      }
    });
  }
  ~BusService() {
    thread_.request_stop();
    thread_.join();
    sd_bus_flush_close_unref(bus_);
  }
  BusService(const BusService&) = delete;
  BusService& operator=(const BusService&) = delete;

 private:
  sd_bus* bus_ = nullptr;
  std::jthread thread_;
};

}  // namespace plumb::testing

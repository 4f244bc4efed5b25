// SPDX-License-Identifier: Apache-2.0
// One thread that does everything with libfreenect, which is not to be called by two at once and
// tells nothing of what is plugged in.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "drivers/freenect/freenect_library.hpp"
#include "drivers/sdk/sdk_host.hpp"

namespace plumb::freenect {

class FreenectHost : public SdkHost {
 public:
  /// Makes a sensor of one of the host's Kinects.
  using OpenSensor = std::function<std::unique_ptr<LiveSensor>(
      std::shared_ptr<FreenectHost> host, SdkOpening opening, const SensorSettings& settings)>;
  /// @throws DeviceError if the library cannot be used.
  FreenectHost(const SensorSettings& settings, OpenSensor open);
  ~FreenectHost() override;

  [[nodiscard]] const SdkLibrary& library() const override { return library_; }
  [[nodiscard]] std::vector<SdkAttached> Attached() override;
  [[nodiscard]] std::unique_ptr<LiveSensor> Open(const std::shared_ptr<SdkHost>& self,
                                                 SdkOpening opening) override;

  /// Runs on the thread of the library, between its events. Waits for it.
  template <typename Task>
  auto Do(Task task) {
    std::packaged_task<std::invoke_result_t<Task>()> packaged(std::move(task));
    auto result = packaged.get_future();
    Queue([&packaged] { packaged(); });
    return result.get();
  }

  // On the thread of the library only.
  [[nodiscard]] const FreenectLibrary& functions() const { return library_; }
  [[nodiscard]] Context* context() const { return context_; }
  /// Of a device, as set_user() has left it: callbacks get nothing else.
  template <typename User>
  [[nodiscard]] static User& UserOf(Device* device) {
    return *static_cast<User*>(Running().get_user(device));
  }
  void CountOpen(int change) {
    num_open_ += change;
    is_broken_ = false;
  }

 private:
  /// The library of the present thread.
  [[nodiscard]] static const FreenectLibrary& Running();
  void Queue(std::function<void()> task);
  void Run(const std::stop_token& stop);
  void RunTasks();
  void LookAtBus();
  [[nodiscard]] std::vector<std::string> Serials() const;

  const SensorSettings settings_;
  const OpenSensor open_;
  const FreenectLibrary library_;
  Context* context_ = nullptr;
  int num_open_ = 0;
  bool is_broken_ = false;  ///< Its events reported an error: an open Kinect is gone.
  int num_attached_ = 0;

  std::mutex tasks_mutex_;
  std::condition_variable_any tasks_changed_;
  std::deque<std::function<void()>> tasks_;
  std::jthread thread_;
};

}  // namespace plumb::freenect

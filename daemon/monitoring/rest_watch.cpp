// SPDX-License-Identifier: Apache-2.0
#include "daemon/monitoring/rest_watch.hpp"

#include <chrono>
#include <optional>
#include <utility>

#include "algo/base/errors.hpp"
#include "algo/monitoring/rest_detector.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/loop/log.hpp"

namespace plumb {
namespace {

// Two seconds of rest are judged by eight looks.
constexpr std::chrono::milliseconds kLookEvery{250};

}  // namespace

RestWatch::RestWatch(EventLoop& loop, const SensorThread& sensors, std::function<void()> changed)
    : loop_(loop),
      sensors_(sensors),
      changed_(std::move(changed)),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

RestWatch::~RestWatch() {
  thread_.request_stop();
  thread_.join();
}

void RestWatch::Watch(const std::filesystem::path& scene) {
  {
    const std::lock_guard lock(mutex_);
    if (scene == wanted_) return;
    wanted_ = scene;
    ++turn_;
  }
  is_at_rest_ = false;
  wake_.notify_all();
}

void RestWatch::Run(const std::stop_token& stop) {
  for (std::uint64_t turn = 0; !stop.stop_requested();) {
    std::filesystem::path scene;
    {
      std::unique_lock lock(mutex_);
      if (!wake_.wait(lock, stop, [&] { return turn_ != turn; })) return;
      turn = turn_;
      scene = wanted_;
    }
    if (scene.empty()) continue;
    try {
      Look(scene, turn, stop);
    } catch (const std::exception& error) {
      // A press starts a sweep, as without a sensor at rest; monitoring by hand says why not.
      Log(LogLevel::kWarning, MessageOf(error).English());
    }
  }
}

void RestWatch::Look(const std::filesystem::path& scene, std::uint64_t turn,
                     const std::stop_token& stop) {
  const Scene stored = ReadStoredScene(scene).scene;
  std::optional<RestDetector> rest;
  bool told = false;
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (wake_.wait_for(lock, stop, kLookEvery, [&] { return turn_ != turn; }) ||
          stop.stop_requested())
        return;
    }
    const std::optional<Frame> frame = sensors_.latest();
    if (!frame) {
      rest.reset();
    } else if (!rest) {
      rest.emplace(stored, sensors_.snapshot().info.intrinsics);
    }
    const bool at_rest = rest && rest->Add(SteadySeconds(), frame->color_rgb);
    if (at_rest != std::exchange(told, at_rest)) Tell(turn, at_rest);
  }
}

void RestWatch::Tell(std::uint64_t turn, bool is_at_rest) {
  loop_.Post("sensor at rest", [this, turn, is_at_rest] {
    {
      const std::lock_guard lock(mutex_);
      if (turn != turn_) return;
    }
    is_at_rest_ = is_at_rest;
    changed_();
  });
}

}  // namespace plumb

// SPDX-License-Identifier: Apache-2.0
// The one thread of a process that waits for images from OpenNI2.
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <vector>

#include "drivers/openni/openni_library.hpp"

namespace plumb {

/// OpenNI2 remembers every thread that ever waited for a stream and, when a new one arrives, asks
/// the system about the old ones; once such a thread has ended, that crashes. Therefore one thread,
/// which never ends, waits for the streams of all open sensors. Add() and Remove() may be called
/// from any other thread.
class StreamWaiter {
 public:
  /// @param stream  0 or 1, for the two streams that were added. Called on the waiting thread; the
  ///         frame is borrowed for the call.
  using OnImage = std::function<void(int stream, const OniFrame& frame)>;

  /// The waiter of a loaded library.
  [[nodiscard]] static StreamWaiter& Of(const OpenNiLibrary& library);

  /// Starts to wait for two started streams. The library must live until Remove().
  [[nodiscard]] std::int64_t Add(const OpenNiLibrary& library,
                                 const std::array<OniStreamHandle, 2>& streams, OnImage on_image);

  /// Returns once the streams are no longer waited for and the function is not running; takes at
  /// most a tenth of a second.
  void Remove(std::int64_t id);

 private:
  struct Entry {
    std::int64_t id = 0;
    const OpenNiLibrary* library = nullptr;
    std::array<OniStreamHandle, 2> streams{};
    OnImage on_image;
  };
  StreamWaiter();
  [[noreturn]] void Run();
  static void WaitOnce(const std::vector<Entry>& entries);

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Entry> entries_;
  std::int64_t next_id_ = 1;
  std::int64_t round_ = 0;
  bool waiting_ = false;  ///< The thread is using a copy of the entries.
};

}  // namespace plumb

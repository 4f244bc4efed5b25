// SPDX-License-Identifier: Apache-2.0
#include "drivers/openni/stream_waiter.hpp"

#include <chrono>
#include <map>
#include <thread>

namespace plumb {
namespace {

// timeout of one wait for images, and the longest duration of Remove()
constexpr int kWait_ms = 100;
constexpr std::chrono::milliseconds kAfterError{
    20};  // OpenNI2 may return at once, always with the same result, after an unplug

}  // namespace

StreamWaiter& StreamWaiter::Of(const OpenNiLibrary& library) {
  // Neither is ever destroyed: the threads live until the end of the process.
  static auto& mutex = *new std::mutex;
  static auto& waiters = *new std::map<decltype(library.WaitForAnyStream), StreamWaiter*>;
  const std::lock_guard lock(mutex);
  StreamWaiter*& waiter = waiters[library.WaitForAnyStream];
  if (waiter == nullptr) waiter = new StreamWaiter;
  return *waiter;
}

StreamWaiter::StreamWaiter() {
  std::thread([this] { Run(); }).detach();
}

std::int64_t StreamWaiter::Add(const OpenNiLibrary& library,
                               const std::array<OniStreamHandle, 2>& streams, OnImage on_image) {
  const std::lock_guard lock(mutex_);
  entries_.push_back({next_id_, &library, streams, std::move(on_image)});
  changed_.notify_all();
  return next_id_++;
}

void StreamWaiter::Remove(std::int64_t id) {
  std::unique_lock lock(mutex_);
  std::erase_if(entries_, [&](const Entry& entry) { return entry.id == id; });
  // The copy that the thread is using may still contain this entry; the next one will not.
  const std::int64_t round = round_;
  changed_.wait(lock, [&] { return !waiting_ || round_ != round; });
}

void StreamWaiter::Run() {
  for (;;) {
    std::vector<Entry> entries;
    {
      std::unique_lock lock(mutex_);
      waiting_ = false;
      ++round_;
      changed_.notify_all();
      changed_.wait(lock, [this] { return !entries_.empty(); });
      waiting_ = true;
      entries = entries_;
    }
    WaitOnce(entries);
  }
}

void StreamWaiter::WaitOnce(const std::vector<Entry>& entries) {
  std::vector<OniStreamHandle> streams;
  for (const Entry& entry : entries)
    streams.insert(streams.end(), entry.streams.begin(), entry.streams.end());
  const OpenNiLibrary& library = *entries.front().library;
  int index = -1;
  const OniStatus status =
      library.WaitForAnyStream(streams.data(), static_cast<int>(streams.size()), &index, kWait_ms);
  if (status == ONI_STATUS_TIME_OUT) return;
  OniFrame* frame = nullptr;
  // Only a stream with an image is read, because reading an unplugged one never returns.
  const bool read =
      status == ONI_STATUS_OK && index >= 0 && index < static_cast<int>(streams.size()) &&
      library.StreamReadFrame(streams[static_cast<std::size_t>(index)], &frame) == ONI_STATUS_OK &&
      frame != nullptr;
  if (!read) {
    std::this_thread::sleep_for(kAfterError);
    return;
  }
  entries[static_cast<std::size_t>(index / 2)].on_image(index % 2, *frame);
  library.FrameRelease(frame);
}

}  // namespace plumb

// SPDX-License-Identifier: Apache-2.0
// argon2id on a separate thread: a hash takes tenths of a second and much memory, and the event
// loop must not wait for it.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace plumb::web {

/// One hash at a time with a short queue, so that memory is bounded. Except for the thread itself,
/// used on the loop thread.
class PasswordWorker {
 public:
  PasswordWorker(std::uint64_t operations, std::uint64_t memory_bytes);
  ~PasswordWorker();
  PasswordWorker(const PasswordWorker&) = delete;
  PasswordWorker& operator=(const PasswordWorker&) = delete;

  /// False if the queue is full; done is then not called.
  /// @param done  Called by Dispatch() with the hash, or with nothing if memory was exhausted.
  [[nodiscard]] bool Hash(std::string password,
                          std::function<void(std::optional<std::string>)> done);
  /// The same for verification. An empty hash never matches but takes as long.
  /// @param done  Gets nothing if memory was exhausted.
  /// @param trusted  Of a known browser or person: handled before strangers, with a queue of its
  ///         own, so that guesses do not delay it.
  [[nodiscard]] bool Verify(std::string password, std::string hash, bool trusted,
                            std::function<void(std::optional<bool>)> done);

  /// Readable when something is done.
  [[nodiscard]] int fd() const { return event_fd_; }
  void Dispatch();

 private:
  /// Runs on the thread; returns what the loop then runs.
  using Job = std::function<std::function<void()>()>;
  [[nodiscard]] bool Enqueue(std::deque<Job>& jobs, Job job);
  void Work(const std::stop_token& stop);

  std::uint64_t operations_;
  std::uint64_t memory_bytes_;
  std::string dummy_hash_;
  int event_fd_ = -1;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::deque<Job> jobs_, trusted_jobs_;
  std::deque<std::function<void()>> finished_;
  std::jthread thread_;
};

}  // namespace plumb::web

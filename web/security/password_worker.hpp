// argon2id on a thread of its own: a hash takes tenths of a second and much memory, the event loop
// must not wait for it.
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

/// One hash at a time, few waiting: the memory is bounded. Everything but the thread itself belongs
/// to the loop thread.
class PasswordWorker {
 public:
  PasswordWorker(std::uint64_t operations, std::uint64_t memory_bytes);
  ~PasswordWorker();
  PasswordWorker(const PasswordWorker&) = delete;
  PasswordWorker& operator=(const PasswordWorker&) = delete;

  /// False: too many wait already, done is not called. @param done  With the hash; nothing where
  /// memory ran out. Called by Dispatch().
  [[nodiscard]] bool Hash(std::string password,
                          std::function<void(std::optional<std::string>)> done);
  /// The same for a check. An empty hash is never right but takes as long.
  /// @param trusted  Of a browser or person that is known: done before what strangers wait for,
  ///                 and with places of its own, so that guesses do not keep them waiting.
  [[nodiscard]] bool Verify(std::string password, std::string hash, bool trusted,
                            std::function<void(bool)> done);

  /// Readable when something is done.
  [[nodiscard]] int fd() const { return event_fd_; }
  void Dispatch();

 private:
  using Job = std::function<std::function<void()>()>;  ///< Runs on the thread, gives what the loop
                                                       ///< shall run.
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

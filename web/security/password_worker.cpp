// SPDX-License-Identifier: Apache-2.0
#include "web/security/password_worker.hpp"

#include <sodium.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "algo/base/errors.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxWaiting = 8;

std::optional<std::string> HashPassword(const std::string& password, std::uint64_t operations,
                                        std::uint64_t memory_bytes) {
  std::array<char, crypto_pwhash_STRBYTES> hash{};
  if (crypto_pwhash_str_alg(hash.data(), password.data(), password.size(), operations, memory_bytes,
                            crypto_pwhash_ALG_ARGON2ID13) != 0) {
    return std::nullopt;
  }
  return std::string(hash.data());
}

void Wipe(std::string& secret) { sodium_memzero(secret.data(), secret.size()); }

}  // namespace

PasswordWorker::PasswordWorker(std::uint64_t operations, std::uint64_t memory_bytes)
    : operations_(operations), memory_bytes_(memory_bytes) {
  if (sodium_init() < 0) throw IoError(say::web::NoRandom());
  event_fd_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (event_fd_ < 0) throw IoError(say::web::CannotMakeEventfd(std::strerror(errno)));
  thread_ = std::jthread([this](const std::stop_token& stop) { Work(stop); });
}

PasswordWorker::~PasswordWorker() {
  thread_.request_stop();
  thread_.join();
  close(event_fd_);
}

bool PasswordWorker::Enqueue(std::deque<Job>& jobs, Job job) {
  const std::lock_guard lock(mutex_);
  if (jobs.size() >= kMaxWaiting) return false;
  jobs.push_back(std::move(job));
  wake_.notify_one();
  return true;
}

bool PasswordWorker::Hash(std::string password,
                          std::function<void(std::optional<std::string>)> done) {
  // Only users who are logged in, or hold the setup code, set passwords.
  return Enqueue(trusted_jobs_,
                 [this, password = std::move(password),
                  done = std::move(done)]() mutable -> std::function<void()> {
                   auto hash = HashPassword(password, operations_, memory_bytes_);
                   Wipe(password);
                   return [done = std::move(done), hash = std::move(hash)] { done(hash); };
                 });
}

bool PasswordWorker::Verify(std::string password, std::string hash, bool trusted,
                            std::function<void(std::optional<bool>)> done) {
  return Enqueue(
      trusted ? trusted_jobs_ : jobs_,
      [this, password = std::move(password), hash = std::move(hash),
       done = std::move(done)]() mutable -> std::function<void()> {
        // An unknown name takes the same time as a wrong password, so that names cannot
        // be probed by timing.
        if (dummy_hash_.empty())
          dummy_hash_ = HashPassword("no account", operations_, memory_bytes_).value_or("");
        const std::string& against = hash.empty() ? dummy_hash_ : hash;
        errno = 0;
        std::optional<bool> matches =
            crypto_pwhash_str_verify(against.c_str(), password.data(), password.size()) == 0 &&
            !hash.empty();
        // libsodium gives the same answer for a wrong password.
        if (!*matches && errno == ENOMEM) matches.reset();
        Wipe(password);
        return [done = std::move(done), matches] { done(matches); };
      });
}

void PasswordWorker::Work(const std::stop_token& stop) {
  while (true) {
    std::unique_lock lock(mutex_);
    const auto has_work = [this] { return !jobs_.empty() || !trusted_jobs_.empty(); };
    if (!wake_.wait(lock, stop, has_work) || stop.stop_requested()) return;
    std::deque<Job>& jobs = trusted_jobs_.empty() ? jobs_ : trusted_jobs_;
    Job job = std::move(jobs.front());
    jobs.pop_front();
    lock.unlock();
    std::function<void()> finish = job();
    lock.lock();
    finished_.push_back(std::move(finish));
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written =
        write(event_fd_, &one, sizeof one);  // cannot fail below 2^64 - 1
  }
}

void PasswordWorker::Dispatch() {
  std::uint64_t count = 0;
  [[maybe_unused]] const auto drained = read(event_fd_, &count, sizeof count);
  std::deque<std::function<void()>> finished;
  {
    const std::lock_guard lock(mutex_);
    finished.swap(finished_);
  }
  for (const std::function<void()>& finish : finished) finish();
}

}  // namespace plumb::web

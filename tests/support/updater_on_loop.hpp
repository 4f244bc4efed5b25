// SPDX-License-Identifier: Apache-2.0
// An updater on its loop, asked from the thread of a test.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "daemon/update/updater.hpp"

namespace plumb::testing {

/// Base of the tests of the updater, whatever RAUC it speaks to. The loop has the main thread.
class UpdaterOnLoop : public ::testing::Test {
 protected:
  /// Runs the test beside the loop. A loop that has ended does not begin again.
  void RunBesideLoop(const std::function<void()>& test) {
    std::jthread player([&] {
      test();
      On([this] { updater_.reset(); });
      loop_.Quit(0);
    });
    loop_.Run();
  }

  /// On the loop's thread; waits for it.
  void On(const std::function<void()>& work) {
    std::promise<void> done;
    loop_.Post("test", [&] {
      work();
      done.set_value();
    });
    done.get_future().wait();
  }

  [[nodiscard]] UpdateStatus StatusNow() {
    UpdateStatus status;
    On([&] { status = updater_->status(); });
    return status;
  }

  /// Waits until `holds` is true; false if it is not within a minute.
  [[nodiscard]] static bool Becomes(const std::function<bool()>& holds) {
    const auto until = EventLoop::Clock::now() + kPatience;
    while (!holds()) {
      if (EventLoop::Clock::now() > until) return false;
      // Asking without a pause would keep the loop busy with answers.
      std::this_thread::sleep_for(kPollInterval);
    }
    return true;
  }

  /// @param name  Of a bundle in the updater's folder.
  Change Install(const std::string& name) {
    return Ask([&](const Done& done) { updater_->Install(name, done); });
  }
  Change InstallCopy(const std::filesystem::path& copy, const std::string& name) {
    return Ask([&](const Done& done) { updater_->InstallCopy(copy, name, done); });
  }
  Change Add(const std::filesystem::path& file, const std::string& name) {
    return Ask([&](const Done& done) { updater_->Add(file, name, done); });
  }

  /// The answer to what is asked on the loop.
  Change Ask(const std::function<void(const Done&)>& request) {
    auto answer = std::make_shared<std::promise<Change>>();
    On([&] { request([answer](const Change& change) { answer->set_value(change); }); });
    auto future = answer->get_future();
    if (future.wait_for(kPatience) != std::future_status::ready) {
      ADD_FAILURE() << "no answer";
      return {};
    }
    return future.get();
  }

  static constexpr std::chrono::seconds kPatience{60};
  static constexpr std::chrono::milliseconds kPollInterval{2};

  EventLoop loop_;  // first: blocks signals before any thread starts
  std::unique_ptr<Updater> updater_;
};

}  // namespace plumb::testing

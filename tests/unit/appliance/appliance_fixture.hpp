// SPDX-License-Identifier: Apache-2.0
// The appliance on its loop, with a sensor and a machine that do what a test says.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include <gtest/gtest.h>

#include "daemon/appliance/appliance.hpp"
#include "daemon/services/web_services.hpp"
#include "tests/support/fake_sensor.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb::testing {

/// Its driver takes as long to open a sensor as the test wants.
class SlowProvider : public FakeProvider {
 public:
  SlowProvider(FakeBus& bus, std::shared_future<void> may_open)
      : FakeProvider(bus), may_open_(std::move(may_open)) {}
  [[nodiscard]] std::unique_ptr<LiveSensor> Open(const std::string& serial) override {
    may_open_.wait();
    return FakeProvider::Open(serial);
  }

 private:
  std::shared_future<void> may_open_;
};

/// A machine that stays on.
class FakeRestart : public SystemRestart {
 public:
  void Restart(std::function<void(const Message&)> done) override {
    ++num_asked;
    if (on_asked) on_asked();
    done(failure.empty() ? Message() : Message::Verbatim(failure));
  }
  [[nodiscard]] std::chrono::milliseconds limit() const override { return stays_up_after; }
  int num_asked = 0;
  std::chrono::milliseconds stays_up_after = std::chrono::minutes(5);
  std::string failure;
  std::function<void()> on_asked;
};

class ApplianceTest : public ::testing::Test {
 protected:
  ApplianceTest() {
    parts_.config.appliance.state = folder_ / "state";
    parts_.config.update.folder = folder_ / "updates";
    parts_.demo_patient = "demo";
    // Independent of the machine's disk: the light shows whether it is nearly full.
    parts_.storage.space = [](const std::filesystem::path&, std::error_code&) {
      return std::filesystem::space_info{
          .capacity = 100'000'000'000, .free = 50'000'000'000, .available = 50'000'000'000};
    };
    parts_.make_provider = [this] { return std::make_unique<SlowProvider>(bus_, may_open_); };
  }

  /// Runs the test beside the loop, which has the main thread; a loop that has ended does not begin
  /// again.
  void Play(const std::function<void()>& test) {
    shared_ = std::make_unique<SharedParts>(loop_, parts_);
    appliance_ = std::make_unique<Appliance>(*shared_);
    auto restart = std::make_unique<FakeRestart>();
    restart_ = restart.get();
    services_ = std::make_unique<WebServices>(*appliance_, *shared_, std::move(restart));
    std::jthread player([&] {
      test();
      if (!opens_) LetOpen();
      loop_.Quit(0);
    });
    loop_.Run();
    services_.reset();
    appliance_.reset();
    shared_.reset();
  }

  /// On the loop's thread; waits for it.
  void On(const std::function<void()>& work) {
    const auto done =
        std::make_shared<std::promise<void>>();  // shared: it wakes us while it is still at it
    loop_.Post("test", [&work, done] {
      work();
      done->set_value();
    });
    done->get_future().wait();
  }
  /// False if it does not come to that in time. A timer of the loop asks again and again.
  /// @param interval  Longer where background work needs the processor.
  [[nodiscard]] bool Becomes(const std::function<bool()>& holds,
                             std::chrono::seconds limit = std::chrono::seconds(30),
                             std::chrono::milliseconds interval = std::chrono::milliseconds(1)) {
    const auto until = EventLoop::Clock::now() + limit;
    const auto answer = std::make_shared<std::promise<bool>>();
    EventLoop::Source timer;
    On([&] {
      timer = loop_.MakeTimer("test", [&, answer] {
        if (holds()) return answer->set_value(true);
        if (EventLoop::Clock::now() >= until) return answer->set_value(false);
        timer.ArmAfter(interval);
      });
      timer.ArmAfter({});
    });
    const bool does = answer->get_future().get();
    On([&] { timer = {}; });
    return does;
  }
  void LetOpen() {
    opens_ = true;
    opener_.set_value();
  }
  void MakeReady() {
    LetOpen();
    bus_.Plug("A");
    bus_.GiveFrame();
    ASSERT_TRUE(Becomes([&] { return appliance_->state().phase == ApplianceState::kReady; }));
  }
  /// On the loop's thread.
  void AddPassedCheck(const Actor& actor) {
    (void)shared_->store->checks.Add(
        actor, appliance_->WebStatus().sensor.serial,
        TakenCheck{{.status = MarkerCheckStatus::kPassed, .items = {}, .reasons = {}}});
  }
  [[nodiscard]] bool IsRunning() const {
    const ApplianceState phase = appliance_->state().phase;
    return phase == ApplianceState::kScanning || phase == ApplianceState::kWorking;
  }

  static inline const Actor kTester{.user = "tester", .address = ""};

  EventLoop loop_;  // first: blocks signals before any thread starts
  TempFolder folder_;
  FakeBus bus_;
  ApplianceParts parts_;
  std::unique_ptr<SharedParts> shared_;
  std::unique_ptr<Appliance> appliance_;
  std::unique_ptr<WebServices> services_;
  FakeRestart* restart_ = nullptr;
  std::promise<void> opener_;
  std::shared_future<void> may_open_ = opener_.get_future().share();
  bool opens_ = false;
};

}  // namespace plumb::testing

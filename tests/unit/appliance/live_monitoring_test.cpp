// SPDX-License-Identifier: Apache-2.0
// Live monitoring on the loop: what it says, and that it never says an old number as a new one.
#include "daemon/appliance/live_monitoring.hpp"

#include <chrono>
#include <future>
#include <memory>
#include <mutex>
#include <semaphore>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/files/scene_folder.hpp"
#include "daemon/monitoring/live_acceptance.hpp"
#include "daemon/monitoring_files/monitoring_file.hpp"
#include "tests/support/rest_frames.hpp"
#include "tests/support/temp_folder.hpp"
#include "web/model/limits.hpp"

namespace plumb::testing {
namespace {

using namespace std::chrono_literals;
using test::RestFrames;
using ::testing::Contains;
using ::testing::HasSubstr;

class LiveMonitoringTest : public ::testing::Test {
 protected:
  LiveMonitoringTest() {
    WriteScene(scene_, folder_ / "scene");
    monitoring_.SetGate([this](bool is_in) { gate_.push_back(is_in); });
    monitoring_.SetHooks(
        {.ask = [](bool, const Actor&) { return Message(); },
         .changed = [this] { patterns_.push_back(monitoring_.Pattern()); },
         .failed =
             [this](const Message& why) {
               failure_ = why;
               failed_.set_value();
             },
         .recorded = [this](const std::string& scan,
                            const std::string& file) { recorded_.set_value(scan + '/' + file); }});
    notices_.SetWatchers([this](const std::string& line) {
      events_.push_back(nlohmann::json::parse(line));
      told_.release();
    });
  }
  ~LiveMonitoringTest() override { monitoring_.SetHooks({}); }

  void Play(const std::function<void()>& test) {
    std::jthread player([&] {
      test();
      loop_.Quit(0);
    });
    loop_.Run();
  }
  void On(const std::function<void()>& work) {
    const auto done = std::make_shared<std::promise<void>>();
    loop_.Post("test", [&work, done] {
      work();
      done->set_value();
    });
    done->get_future().wait();
  }
  MonitorStatus Status() {
    MonitorStatus status;
    On([&] { status = monitoring_.status(); });
    return status;
  }
  nlohmann::json LastEvent() {
    nlohmann::json event;
    On([&] { event = events_.back(); });
    return event;
  }
  void Begin(std::optional<MonitorRecordPlace> record = {}, const Message& why_no_record = {}) {
    On([&] {
      feed_ = std::make_shared<LiveFeed>(1000);
      CurrentScan scan;
      scan.id = "scan-1";
      scan.patient_id = "patient-1";
      monitoring_.Begin({.info = frames_.info(),
                         .compare = {},
                         .room = {},
                         .scene = folder_ / "scene",
                         .reference_scene = {},
                         .check_reference = {},
                         .record = std::move(record)},
                        feed_, scan, why_no_record);
    });
  }
  void Push(double until_s) {
    for (; time_s_ < until_s; time_s_ += 1.0 / RestFrames::kRate_hz)
      feed_->Push(frames_.At(time_s_));
  }
  /// Looks after each event; false if that does not hold within 20 s.
  bool Becomes(const std::function<bool(const MonitorStatus&)>& holds) {
    const auto end = std::chrono::steady_clock::now() + 20s;
    while (!holds(Status()))
      if (!told_.try_acquire_until(end)) return false;
    return true;
  }
  /// A frame after each event until that holds; false if it does not within 20 s.
  bool PushUntil(const std::function<bool(const MonitorStatus&)>& holds) {
    return Becomes([&](const MonitorStatus& now) {
      if (holds(now)) return true;
      Push(time_s_ + 0.5 / RestFrames::kRate_hz);
      return false;
    });
  }

  Scene scene_ = test::ScannedBody();
  RestFrames frames_{scene_, 1.0, 5};
  EventLoop loop_;
  TempFolder folder_;
  Notices notices_{[] {}};
  WorkThread store_thread_{16};
  LiveMonitoring monitoring_{loop_, notices_, store_thread_};
  std::shared_ptr<LiveFeed> feed_;
  std::vector<bool> gate_;
  std::vector<IndicatorPattern> patterns_;
  std::vector<nlohmann::json> events_;
  Message failure_;
  std::promise<void> failed_;
  std::promise<std::string> recorded_;
  std::counting_semaphore<> told_{0};  ///< Released by each event.
  double time_s_ = 50.0;
};

TEST_F(LiveMonitoringTest, ComesInAndAnOldNumberBecomesUnknownThenGoes) {
  Play([&] {
    EXPECT_FALSE(Status().active);
    Begin();
    EXPECT_EQ(Status().state, "mounting");
    Push(60.0);
    ASSERT_TRUE(PushUntil([](const MonitorStatus& now) { return now.advice == "in"; }));
    MonitorStatus now = Status();
    EXPECT_EQ(now.state, "monitoring");
    ASSERT_TRUE(now.since_zero);
    EXPECT_FALSE(now.against_reference);
    EXPECT_LT(std::abs(now.since_zero->value[0]), 1.0);
    EXPECT_TRUE(now.has_breathing);
    EXPECT_EQ(monitoring_.Pattern(), IndicatorPattern::kMonitorIn);

    // No image comes.
    ASSERT_TRUE(Becomes([&](const MonitorStatus& status) {
      return status.is_old && LastEvent().at("advice") == "unknown";
    }));
    now = Status();
    EXPECT_EQ(now.advice, "unknown");
    EXPECT_EQ(now.reason, "no_image");
    EXPECT_TRUE(now.is_old);
    EXPECT_GT(now.age_s.value_or(0), 0.2);
    EXPECT_TRUE(now.since_zero) << "shown grey";
    On([&] {
      EXPECT_FALSE(gate_.back());
      EXPECT_EQ(patterns_.back(), IndicatorPattern::kMonitorUnknown);
      EXPECT_EQ(events_.back().at("advice"), "unknown");
    });
    ASSERT_TRUE(Becomes([&](const MonitorStatus& status) {
      return !status.since_zero && LastEvent().at("since_zero").is_null();
    }));
    now = Status();
    EXPECT_GE(now.age_s.value_or(1.0), 1.0) << "gone after a second";
    EXPECT_EQ(now.state, "blind");
    On([&] { EXPECT_TRUE(events_.back().at("since_zero").is_null()); });

    std::string record;
    On([&] { record = monitoring_.Record()->Csv(); });
    EXPECT_THAT(record, HasSubstr(",monitoring,in,"));
    Message said;
    On([&] { said = monitoring_.End({}); });
    EXPECT_THAT(said.English(), HasSubstr("unknown"));
    EXPECT_FALSE(Status().active);
    On([&] {
      EXPECT_FALSE(events_.back().at("active"));
      EXPECT_THAT(gate_, Contains(true));
      EXPECT_FALSE(gate_.back());
    });
  });
}

TEST_F(LiveMonitoringTest, TheGateHoldsOutsideTheTaughtBreathAndTheRecordTellsIt) {
  Play([&] {
    BreathHold taught;
    On([&] { EXPECT_FALSE(monitoring_.TeachBreath(3.0, taught).empty()) << "none goes on"; });
    Begin(MonitorRecordPlace{.scan = folder_.path(), .head = {{"scan", "scan-1"}}});
    Push(60.0);
    ASSERT_TRUE(PushUntil([](const MonitorStatus& now) { return now.advice == "in"; }));
    EXPECT_TRUE(Status().is_recorded);
    EXPECT_FALSE(Status().breath_hold);
    // The body breathes by 6 mm: what is taught at the end of an expiration is left by the next
    // breath, though the body lies still.
    const auto teach = [&](const MonitorStatus&) {
      Message why;
      On([&] { why = monitoring_.TeachBreath(3.0, taught); });
      return why.empty();
    };
    ASSERT_TRUE(PushUntil(teach));
    EXPECT_EQ(taught.window_mm, 3.0);
    ASSERT_TRUE(PushUntil([](const MonitorStatus& now) {
      return now.breath_hold && now.breath_hold->advice == "out";
    }));
    EXPECT_EQ(Status().advice, "out");
    EXPECT_NEAR(Status().breath_hold->level_mm, taught.level_mm, 1e-9);
    ASSERT_TRUE(PushUntil([](const MonitorStatus& now) { return now.advice == "in"; }));
    On([&] {
      EXPECT_TRUE(monitoring_.ForgetBreath().empty());
      EXPECT_FALSE(monitoring_.ForgetBreath().empty()) << "once";
      monitoring_.NoteAccepted({.by = "anna", .at = "now", .reason = "", .against_reference = {}},
                               "in");
    });
    EXPECT_EQ(Status().accepted->by, "anna");
    On([&] { (void)monitoring_.End({}); });
    std::future<std::string> recorded = recorded_.get_future();
    ASSERT_EQ(recorded.wait_for(20s), std::future_status::ready);
    EXPECT_EQ(recorded.get(), "scan-1/monitoring/01.plm");
  });
  const StoredMonitoring stored = ReadMonitoringFile(folder_ / "monitoring/01.plm");
  EXPECT_FALSE(stored.is_cut_off);
  std::vector<std::string> events;
  for (const nlohmann::json& event : stored.events) events.push_back(event.at("event"));
  EXPECT_THAT(events, ::testing::ElementsAre("zero", "breath_taught", "breath_forgotten",
                                             "accepted", "ended"));
  EXPECT_EQ(MonitoringCsv(stored.record).substr(0, 400), monitoring_.Record()->Csv().substr(0, 400))
      << "before the first numbers both have the same";
}

TEST_F(LiveMonitoringTest, GoesOnWithoutARecordAndSaysSo) {
  Play([&] {
    Begin({}, Message::Verbatim("no room"));
    EXPECT_FALSE(Status().is_recorded);
    ASSERT_EQ(Status().warnings.size(), 1u);
    On([&] { (void)monitoring_.End({}); });
    Begin(MonitorRecordPlace{.scan = folder_ / "gone", .head = {{"scan", "scan-1"}}});
    Push(time_s_ + 1.0);
    ASSERT_TRUE(Becomes([](const MonitorStatus& now) { return !now.is_recorded; }));
    EXPECT_EQ(Status().warnings.size(), 1u);
    EXPECT_EQ(Status().state, "mounting");
    EXPECT_FALSE(std::filesystem::exists(folder_ / "gone"));
    On([&] { (void)monitoring_.End({}); });
  });
}

class LiveAcceptanceTest : public ::testing::Test {
 protected:
  LiveAcceptanceTest() {
    now_.active = now_.judges_reference = true;
    now_.state = "monitoring";
    now_.advice = "in";
    now_.age_s = 0.05;
    now_.against_reference.emplace().value = {1.25, -0.5, 0, 0, 0, 0.1};
  }
  [[nodiscard]] bool May(bool has_reason = false) const {
    return WhyNotAcceptLive(now_, kBySignature, has_reason).empty();
  }
  MonitorStatus now_;
};

TEST_F(LiveAcceptanceTest, OnlyWhereASignatureIsAskedFor) {
  EXPECT_TRUE(May());
  EXPECT_FALSE(WhyNotAcceptLive(now_, kBySweep, true).empty());
  EXPECT_FALSE(WhyNotAcceptLive(now_, "", true).empty());
  now_.active = false;
  EXPECT_FALSE(May());
}

TEST_F(LiveAcceptanceTest, OnlyWhatIsKnownNow) {
  const MonitorStatus good = now_;
  for (const char* state : {"mounting", "zeroing", "blind", "moved_sensor"}) {
    now_.state = state;
    EXPECT_FALSE(May()) << state;
  }
  now_ = good;
  now_.advice = "unknown";
  EXPECT_FALSE(May(true));
  now_ = good;
  now_.age_s = kLongestGap_s;
  EXPECT_TRUE(May());
  now_.age_s = kLongestGap_s + 0.001;
  EXPECT_FALSE(May());
  now_.age_s.reset();
  EXPECT_FALSE(May());
}

TEST_F(LiveAcceptanceTest, OnlyAgainstAReference) {
  now_.judges_reference = false;
  EXPECT_FALSE(May());
  now_.judges_reference = true;
  now_.against_reference.reset();
  now_.since_zero.emplace();
  EXPECT_FALSE(May());
}

TEST_F(LiveAcceptanceTest, OutOfToleranceOnlyWithAReason) {
  now_.advice = "out";
  EXPECT_FALSE(May());
  EXPECT_TRUE(May(true));
  EXPECT_THAT(DescribeAccepted(now_, "swelling").English(),
              ::testing::AllOf(HasSubstr("out"), HasSubstr("+1.25 mm"), HasSubstr("swelling")));
}

TEST_F(LiveMonitoringTest, ASceneThatCannotBeReadFails) {
  Play([&] {
    std::filesystem::remove_all(folder_ / "scene");
    Begin();
    ASSERT_EQ(failed_.get_future().wait_for(20s), std::future_status::ready);
    On([&] {
      EXPECT_FALSE(failure_.empty());
      (void)monitoring_.End(failure_);
      EXPECT_EQ(monitoring_.status().ended.English(), failure_.English());
    });
  });
}

}  // namespace
}  // namespace plumb::testing

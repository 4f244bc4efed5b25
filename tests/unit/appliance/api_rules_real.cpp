// SPDX-License-Identifier: Apache-2.0
// The rules on the real services and their store, with a sensor of the test's own.
#include <sys/epoll.h>

#include <future>
#include <stdexcept>
#include <thread>

#include "daemon/appliance/appliance.hpp"
#include "daemon/sensor_profiles/profile_shelf.hpp"
#include "daemon/services/web_services.hpp"
#include "tests/support/api_rules.hpp"
#include "tests/support/board_checks.hpp"
#include "tests/support/fake_sensor.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/records/scan_folder.hpp"
#include "web/api/http_server.hpp"

namespace plumb::test {
namespace {

/// Asked for nothing by these rules.
class NoRestart : public SystemRestart {
 public:
  void Restart(std::function<void(const Message&)> done) override {
    done(Message::Verbatim("not here"));
  }
};

/// Made, used and destroyed on the loop's thread.
struct Served {
  Served(EventLoop& loop, const ApplianceParts& parts)
      : shared(loop, parts),
        appliance(shared),
        services(appliance, shared, std::make_unique<NoRestart>()),
        http(services.services(), CheapPasswords()) {
    timer = loop.MakeTimer("http", [this] { Run(); });
    source = loop.WatchDescriptor("http", http.fd(), EPOLLIN, [this](std::uint32_t) { Run(); });
    Run();
  }
  static web::HttpServerOptions CheapPasswords() {
    web::HttpServerOptions options;
    options.password_memory_bytes = 1 << 20;
    options.password_operations = 1;
    return options;
  }
  void Run() {
    http.Run();
    if (const auto timeout = http.timeout()) {
      timer.ArmAfter(*timeout);
    } else {
      timer.Disarm();
    }
  }

  SharedParts shared;
  Appliance appliance;
  WebServices services;
  web::HttpServer http;
  EventLoop::Source timer, source;
};

class RealRuledAppliance : public RuledAppliance {
 public:
  RealRuledAppliance() {
    parts_.config.appliance.state = folder_ / "state";
    parts_.config.appliance.warm_up_min = 0;
    parts_.config.appliance.backup_folder = folder_ / "backups";
    parts_.config.update.folder = folder_ / "updates";
    parts_.make_provider = [this] { return std::make_unique<testing::FakeProvider>(bus_); };
    bus_.Plug("A");
    bus_.GiveFrame();
    std::promise<void> serves;
    thread_ = std::jthread([this, &serves] {
      EventLoop loop;
      {
        Served served(loop, parts_);
        loop_ = &loop;
        served_ = &served;
        serves.set_value();
        loop.Run();
        loop_ = nullptr;
      }
    });
    serves.get_future().wait();
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    for (bool ready = false; !ready;) {
      On([&] { ready = served_->appliance.state().phase == ApplianceState::kReady; });
      if (std::chrono::steady_clock::now() > end)
        throw std::runtime_error("the sensor does not get ready");
      std::this_thread::yield();
    }
  }
  ~RealRuledAppliance() override { loop_->Quit(0); }
  RealRuledAppliance(const RealRuledAppliance&) = delete;
  RealRuledAppliance& operator=(const RealRuledAppliance&) = delete;

  [[nodiscard]] std::uint16_t port() const override { return served_->http.port(); }
  [[nodiscard]] std::string setup_code() const override {
    return served_->http.setup_code().value_or("");
  }
  std::string StoreScan(const std::string& patient_id) override {
    std::string id;
    On([&] {
      Store& store = *served_->shared.store.get();
      id = store.scans.Begin({.patient_id = patient_id,
                              .reference_id = {},
                              .purpose = ScanPurpose::kReference,
                              .sensor_serial = "A"});
      testing::FillScan(store.folders.Staging(id));
      store.scans.Finish(id, {.outcome = ScanOutcome::kDone});
    });
    return id;
  }
  std::string PassDailyCheck(const std::string& user) override {
    std::string id;
    On([&] {
      id = served_->shared.store->checks.Add({.user = user, .address = {}}, "A",
                                             testing::CheckOver());
    });
    return id;
  }
  void ScanBoard() override { (void)PassDailyCheck("technician"); }  // sees it, too
  void LearnProfile() override {
    SensorProfile profile = ProfileOfAnyUnit(testing::FakeBus::Info().intrinsics);
    profile.num_sweeps = 4;
    On([&] { (void)served_->shared.profiles.shelf()->Add("A", profile); });
  }

 private:
  /// On the loop's thread; waits for it.
  void On(const std::function<void()>& work) {
    const auto done = std::make_shared<std::promise<void>>();
    loop_->Post("test", [&work, done] {
      work();
      done->set_value();
    });
    done->get_future().wait();
  }

  testing::TempFolder folder_;
  testing::FakeBus bus_;
  ApplianceParts parts_;
  EventLoop* loop_ = nullptr;
  Served* served_ = nullptr;
  std::jthread thread_;  // ends first
};

}  // namespace

std::unique_ptr<RuledAppliance> MakeRuledAppliance() {
  return std::make_unique<RealRuledAppliance>();
}

}  // namespace plumb::test

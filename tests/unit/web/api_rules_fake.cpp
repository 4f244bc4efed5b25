// SPDX-License-Identifier: Apache-2.0
// The rules on the fake appliance.
#include <fmt/format.h>

#include <fstream>

#include "tests/support/api_rules.hpp"
#include "tests/support/fake_appliance.hpp"
#include "tests/support/http_client.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb::test {
namespace {

class FakeRuledAppliance : public RuledAppliance {
 public:
  FakeRuledAppliance() {
    service_.SetOverdue(Message::Verbatim("No daily check has passed today: open Daily check."));
    web::HttpServerOptions options;
    options.password_memory_bytes = 1 << 20;
    options.password_operations = 1;
    service_.status.sensor.present = true;
    service_.profiles.serial = "A";
    service_.diagnostics_file = folder_ / "diagnostics.txt";
    std::ofstream(service_.diagnostics_file) << "health: ok";
    server_ = std::make_unique<web::HttpServer>(service_.services(), options);
    loop_ = std::make_unique<ServingLoop>(*server_);
  }
  [[nodiscard]] std::uint16_t port() const override { return server_->port(); }
  [[nodiscard]] std::string setup_code() const override {
    return server_->setup_code().value_or("");
  }
  std::string StoreScan(const std::string& patient_id) override {
    Scan scan;
    scan.patient_id = patient_id;
    scan.outcome = ScanOutcome::kDone;
    scan.finished_at = WallClock::now();
    loop_->Do([&] {
      scan.id = fmt::format("s{}", ++num_scans_);
      service_.scans.push_back(scan);
    });
    return scan.id;
  }
  std::string PassDailyCheck(const std::string& user) override {
    CheckRecord check;
    check.user = user;
    check.status = MarkerCheckStatus::kPassed;
    check.num_markers = 6;
    loop_->Do([&] {
      check.id = fmt::format("c{}", ++num_checks_);
      service_.checks.checks.push_back(check);
      service_.SetOverdue({});
    });
    return check.id;
  }
  void ScanBoard() override {
    loop_->Do([&] { service_.SeeBoard({}); });
  }
  void LearnProfile() override {
    loop_->Do([&] {
      auto& versions = service_.profiles.versions;
      SensorProfileVersion learned;
      learned.version = static_cast<int>(versions.size()) + 1;
      learned.cause = ProfileCause::kLearned;
      learned.num_sweeps = 4;
      versions.insert(versions.begin(), learned);
    });
  }

 private:
  plumb::testing::TempFolder folder_;
  FakeAppliance service_;
  std::unique_ptr<web::HttpServer> server_;
  std::unique_ptr<ServingLoop> loop_;  // ends first
  int num_scans_ = 0, num_checks_ = 0;
};

}  // namespace

std::unique_ptr<RuledAppliance> MakeRuledAppliance() {
  return std::make_unique<FakeRuledAppliance>();
}

}  // namespace plumb::test

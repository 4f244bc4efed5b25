// The result for browsers without script: when it says that it is old.
#include <gmock/gmock.h>

#include "tests/unit/web/web_fixture.hpp"

namespace plumb::test {
namespace {

using std::chrono::seconds;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kOld = "OLD: do not act on it.";

class ResultPageTest : public WebTest {
 protected:
  void SetUp() override {
    Start();
    SetUpAccounts();
    client_ = std::make_unique<HttpClient>(LoggedIn("technician"));
  }
  /// A scan in tolerance that ended so long ago, by the wall clock.
  void Add(const std::string& id, seconds age, web::ScanOutcome outcome = web::ScanOutcome::kDone) {
    loop_->Do([&] {
      web::Scan scan;
      scan.id = id;
      scan.outcome = outcome;
      scan.failure = outcome == web::ScanOutcome::kFailed ? "tracking was lost" : "";
      scan.started_at = web::WallClock::now() - age - seconds(20);
      scan.finished_at = web::WallClock::now() - age;
      scan.result = web::ResultSummary{};
      scan.result->verdict = "in_tolerance";
      service_.scans.push_back(scan);
    });
  }
  [[nodiscard]] std::string Page() { return client_->Get("/result").body; }

  std::unique_ptr<HttpClient> client_;
};

TEST_F(ResultPageTest, AFreshResultIsNotOld) {
  Add("s1", seconds(90));
  EXPECT_THAT(Page(), HasSubstr("IN TOLERANCE"));
  EXPECT_THAT(Page(), Not(HasSubstr(kOld)));
  EXPECT_THAT(Page(), HasSubstr("class=\"fresh\""));
}

TEST_F(ResultPageTest, AfterTwoMinutesItIsOld) {
  Add("s1", seconds(121));
  EXPECT_THAT(Page(), HasSubstr(kOld));
  EXPECT_THAT(Page(), HasSubstr("class=\"old\""));
}

TEST_F(ResultPageTest, AResultOfTheFutureIsOldBecauseTheClockHasStepped) {
  Add("s1", seconds(-60));
  EXPECT_THAT(Page(), HasSubstr("the clock has stepped"));
  EXPECT_THAT(Page(), HasSubstr(kOld));
}

TEST_F(ResultPageTest, AfterAScanThatFailedTheOneBeforeItIsOld) {
  Add("s1", seconds(30));
  Add("s2", seconds(5), web::ScanOutcome::kFailed);
  EXPECT_THAT(Page(), HasSubstr("from before it"));
  EXPECT_THAT(Page(), HasSubstr(kOld));
}

TEST_F(ResultPageTest, WhileAScanRunsTheOneBeforeItIsOld) {
  Add("s1", seconds(30));
  EXPECT_EQ(client_->Post("/api/v1/press").status, 200);
  EXPECT_THAT(Page(), HasSubstr("A new scan is running."));
  EXPECT_THAT(Page(), HasSubstr(kOld));
}

TEST_F(ResultPageTest, AChangeWhoseSessionEndsWhileItsBodyComesIsRefused) {
  const std::string body = R"({"code":"PX-1","site":"thorax"})";
  HttpConnection slow(port_);
  slow.Send("POST /api/v1/patients HTTP/1.1\r\nHost: localhost\r\nCookie: " + client_->cookie +
            "\r\nX-CSRF-Token: " + client_->csrf_token +
            "\r\nContent-Type: application/json\r\nContent-Length: " + std::to_string(body.size()) +
            "\r\n\r\n" + body.substr(0, 5));
  EXPECT_EQ(client_->Get("/api/v1/status").status, 200);  // the head has been judged by now
  EXPECT_EQ(client_->Post("/api/v1/logout").status, 200);
  slow.Send(body.substr(5));
  EXPECT_EQ(slow.Read().status, 401);
  EXPECT_TRUE(service_.patients.empty());
}

}  // namespace
}  // namespace plumb::test

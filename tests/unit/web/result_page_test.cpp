// SPDX-License-Identifier: Apache-2.0
// The result for browsers without script: when it says that it is old.
#include <gmock/gmock.h>

#include "tests/unit/web/web_fixture.hpp"
#include "web/exchange/preferred_language.hpp"
#include "words/acceptance.hpp"
#include "words/body.hpp"
#include "words/direction.hpp"
#include "words/number.hpp"

namespace plumb::test {
namespace {

using std::chrono::seconds;
using ::testing::AllOf;
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
  /// A scan in tolerance that ended so long ago, by both clocks. A completed one is the last result
  /// that the status names.
  void Add(const std::string& id, seconds age, ScanOutcome outcome = ScanOutcome::kDone) {
    loop_->Do([&] {
      Scan scan;
      scan.id = id;
      scan.outcome = outcome;
      if (outcome == ScanOutcome::kFailed) scan.failure = Message::Verbatim("tracking was lost");
      scan.started_at = WallClock::now() - age - seconds(20);
      scan.finished_at = WallClock::now() - age;
      scan.result = ResultSummary{};
      scan.result->verdict = Verdict::kInTolerance;
      service_.scans.push_back(scan);
      if (outcome != ScanOutcome::kDone) return;
      scan.age_s = static_cast<double>(age.count());
      service_.status.last_result = scan;
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

TEST_F(ResultPageTest, WhatIsToBeKnownStandsBesideTheVerdict) {
  Add("s1", seconds(10));
  EXPECT_THAT(Page(), Not(HasSubstr("overdue")));
  loop_->Do([&] { service_.scans.back().daily_check = DailyCheck::kOverdue; });
  EXPECT_THAT(Page(), HasSubstr("<p class=\"caution\">The daily check was overdue at this scan."));
  loop_->Do([&] { service_.scans.back().daily_check = DailyCheck::kFailed; });
  EXPECT_THAT(Page(), AllOf(HasSubstr("<p class=\"caution\">The daily check had failed before"),
                            Not(HasSubstr("overdue"))));
}

TEST_F(ResultPageTest, TheNumbersHaveTheNamesThatTheResultGivesThem) {
  Add("s1", seconds(10));
  loop_->Do([&] {
    service_.scans.back().result->correction.emplace().longitudinal_mm = 1.0;
    service_.scans.back().result->axes[1] = Message::Verbatim("Patient <head>");
  });
  EXPECT_THAT(Page(), AllOf(HasSubstr("<th scope=\"row\">Patient &lt;head&gt;</th>"),
                            Not(HasSubstr("Longitudinal"))));
}

TEST_F(ResultPageTest, AnAcceptanceWithAReasonIsInTheWordsOfItsVerdict) {
  Add("s1", seconds(10));
  const auto accepted = [&](Verdict verdict) {
    loop_->Do([&] {
      service_.scans.back().result->verdict = verdict;
      service_.scans.back().accepted_by = "anna";
      service_.scans.back().accepted_reason = "as <before>";
    });
    return Page();
  };
  EXPECT_THAT(accepted(Verdict::kMove),
              HasSubstr("Accepted outside tolerance by anna: as &lt;before&gt;"));
  EXPECT_THAT(accepted(Verdict::kUnsure),
              AllOf(HasSubstr("Accepted although inconclusive, by anna"),
                    Not(HasSubstr("Accepted outside"))));
}

TEST_F(ResultPageTest, AfterTwoMinutesItIsOld) {
  Add("s1", seconds(120));
  EXPECT_THAT(Page(), Not(HasSubstr(kOld)));
  loop_->Do([&] { service_.status.last_result->age_s = 120.5; });
  EXPECT_THAT(Page(), HasSubstr(kOld));
  EXPECT_THAT(Page(), HasSubstr("class=\"old\""));
}

TEST_F(ResultPageTest, TheWallClockMakesNoResultFresh) {
  Add("s1", seconds(10));
  loop_->Do(
      [&] { service_.status.last_result->age_s = 600; });  // the wall clock was set back meanwhile
  EXPECT_THAT(Page(), AllOf(HasSubstr(kOld), HasSubstr("10 min ago")));
  loop_->Do([&] {
    service_.status.last_result->age_s.reset();
    service_.status.last_result->finished_at.reset();
  });
  EXPECT_THAT(Page(), HasSubstr(kOld)) << "its age is not known";
  loop_->Do([&] { service_.status.last_result.reset(); });  // a restart of the appliance
  for (const char* path : {"/result", "/result?scan=s1"})
    EXPECT_THAT(client_->Get(path).body, HasSubstr(kOld)) << path;
}

TEST_F(ResultPageTest, AResultOfTheFutureIsOldUnlessTheSteadyClockKnowsItsAge) {
  Add("s1", seconds(-60));
  loop_->Do([&] { service_.status.last_result->age_s = 30; });
  EXPECT_THAT(Page(), AllOf(Not(HasSubstr(kOld)), Not(HasSubstr("the clock has stepped"))));
  loop_->Do([&] { service_.status.last_result.reset(); });
  EXPECT_THAT(Page(), HasSubstr("the clock has stepped"));
  EXPECT_THAT(Page(), HasSubstr(kOld));
}

TEST_F(ResultPageTest, OnlyTheResultOfTheSessionThatIsOpenIsNotOld) {
  Add("s1", seconds(10));
  const auto open = [&](const std::string& session, const std::string& patient) {
    loop_->Do([&] {
      TreatmentSession& opened = service_.status.session.emplace();
      opened.id = session;
      opened.patient_id = patient;
    });
  };
  loop_->Do([&] {
    service_.scans.back().patient_id = "p1";
    service_.scans.back().session_id = "t1";
  });
  EXPECT_THAT(Page(), HasSubstr(kOld)) << "the session is closed";
  open("t1", "p1");
  EXPECT_THAT(Page(), Not(HasSubstr(kOld)));
  open("t2", "p1");
  EXPECT_THAT(Page(), HasSubstr(kOld)) << "the same patient, on another day";
  open("t3", "p2");
  EXPECT_THAT(Page(), HasSubstr(kOld)) << "another patient is on the couch";
}

TEST_F(ResultPageTest, AfterAScanThatFailedTheOneBeforeItIsOld) {
  Add("s1", seconds(30));
  Add("s2", seconds(5), ScanOutcome::kFailed);
  EXPECT_THAT(Page(), HasSubstr("from before it"));
  EXPECT_THAT(Page(), HasSubstr(kOld));
  EXPECT_THAT(client_->Get("/result?scan=s1").body,
              AllOf(HasSubstr(kOld), Not(HasSubstr("from before it"))));
}

TEST_F(ResultPageTest, WhileAScanRunsTheOneBeforeItIsOld) {
  Add("s1", seconds(30));
  EXPECT_EQ(client_->Post("/api/v1/press").status, 200);
  EXPECT_THAT(Page(), HasSubstr("A new scan is running."));
  EXPECT_THAT(Page(), HasSubstr(kOld));
}

TEST_F(ResultPageTest, ItSpeaksTheBrowsersLanguageOrTheOneThatIsAskedFor) {
  Add("s1", seconds(90));
  loop_->Do([&] {
    ResultSummary& result = *service_.scans.back().result;
    result.verdict = Verdict::kMove;
    result.judgements[0] = NumberJudgement::kOutside;
    result.correction.emplace().vertical_mm = -8.04;
    result.correction->pitch_deg = 0.0;
    result.u95.emplace().vertical_mm = 0.9;
    result.u95->pitch_deg = 0.14;
    result.correction->yaw_deg = 0.05;
    result.u95->yaw_deg = 0.04;
    result.reasons = {say::acceptance::Outside(
        3, 1,
        {say::acceptance::OutsideShift(say::number::Vertical(), -8, say::direction::Down())})};
    result.words[0] = say::direction::Down();
    result.body_after = {say::body::High(say::body::LeftShoulder(), 9)};
  });
  EXPECT_THAT(Page(), AllOf(HasSubstr("<html lang=\"en\">"), HasSubstr("<td>\u22128.0 mm</td>"),
                            HasSubstr(">\u00b10.9 mm</td>"), HasSubstr(">\u00b13 mm</td>"),
                            HasSubstr("<td>+0.05\u00b0</td>"), HasSubstr(">\u00b10.04\u00b0</td>"),
                            HasSubstr("outside 3 mm and 1\u00b0: vertical \u22128.0 mm (down)"),
                            HasSubstr("<td>down</td>"), HasSubstr(">MOVE<")));
  EXPECT_THAT(client_->Get("/result?language=xx").body, HasSubstr("<html lang=\"en\">"));
  client_->extra_headers["Accept-Language"] = "xx, es-MX;q=0.9, en;q=0.8";
  const std::string spanish = Page();
  EXPECT_THAT(
      spanish,
      AllOf(HasSubstr("<html lang=\"es\">"), HasSubstr("\u22128,0 mm"),
            HasSubstr("\u00b10,14\u00b0"), HasSubstr(">MOVER<"), HasSubstr("hace 1 min"),
            HasSubstr("No es un producto sanitario"), HasSubstr("refresh"),
            HasSubstr("fuera de 3 mm y 1\u00b0: vertical \u22128,0 mm (abajo)"),
            HasSubstr("<td>abajo</td>"), HasSubstr("hombro izquierdo: 9 mm demasiado alto")));
  for (const char* english : {"MOVE<", "tolerance<", "Scan ", "Patient"})
    EXPECT_THAT(spanish, Not(HasSubstr(english)));
  EXPECT_THAT(client_->Get("/result?language=en").body, HasSubstr(">MOVE<"));
  // The page that asks for itself again stays in the language that was chosen.
  EXPECT_THAT(client_->Get("/result?again&language=en").body,
              HasSubstr("/result?again&amp;language=en"));
  EXPECT_THAT(client_->Get("/result?scan=s1&language=es").body,
              AllOf(HasSubstr("no la aplique ahora"), Not(HasSubstr("refresh")),
                    HasSubstr("/result?scan=s1&amp;language=en")));
  HttpClient stranger(port_);
  stranger.extra_headers["Accept-Language"] = "es";
  EXPECT_THAT(stranger.Get("/result?failed=1").body, HasSubstr("Nombre o contraseña incorrectos"));
}

TEST_F(ResultPageTest, WhatIsNotSurelyWithinAsksForAnotherScan) {
  Add("s1", seconds(30));
  loop_->Do([&] {
    ResultSummary& result = *service_.scans.back().result;
    result.verdict = Verdict::kUnsure;
    result.judgements = {NumberJudgement::kUnsure, NumberJudgement::kWithin};
    result.correction.emplace().vertical_mm = 2.8;
    result.correction->longitudinal_mm = 0.5;
    result.u95.emplace().vertical_mm = 1.2;
    result.u95->longitudinal_mm = 0.3;
  });
  EXPECT_THAT(Page(), AllOf(HasSubstr("<td>inconclusive</td><td>scan again</td>"),
                            HasSubstr("<td>in tolerance</td><td>no move needed</td>"),
                            HasSubstr("Measured difference"), Not(HasSubstr("to apply"))));
}

TEST_F(ResultPageTest, AnAbsentUncertaintyIsNotKnownAndAsksForAnotherScan) {
  Add("s1", seconds(30));
  loop_->Do([&] {
    ResultSummary& result = *service_.scans.back().result;
    result.verdict = Verdict::kUnsure;
    result.correction.emplace().vertical_mm = 0.8;
    result.u95.emplace().longitudinal_mm = 0.3;
  });
  EXPECT_THAT(Page(), AllOf(HasSubstr("\">not known</td>"),
                            HasSubstr("<td>not known</td><td>scan again</td>"),
                            Not(HasSubstr("<td>in tolerance</td>"))));
}

TEST(PreferredLanguage, TheHigherWeightCounts) {
  const Catalogue spanish{"es", "Espa\u00f1ol", "es-ES", ',', false, {}};
  const Catalogue french{"fr", "Fran\u00e7ais", "fr-FR", ',', true, {}};
  const std::vector<const Catalogue*> known = {&EnglishCatalogue(), &spanish, &french};
  const auto preferred = [&](std::string_view header) {
    return web::PreferredLanguage(header, known).code;
  };
  EXPECT_EQ(preferred(""), "en");
  EXPECT_EQ(preferred("xx"), "en");
  EXPECT_EQ(preferred("es"), "es");
  EXPECT_EQ(preferred("ES-ar"), "es");
  EXPECT_EQ(preferred("est"), "en") << "Estonian";
  EXPECT_EQ(preferred("en;q=0.5, es;q=0.6"), "es");
  EXPECT_EQ(preferred("en;q=0.6, es;q=0.5"), "en");
  EXPECT_EQ(preferred("en;q=0.5, es;q=0.6, fr-CA;q=0.7"), "fr");
  EXPECT_EQ(preferred("es;q=0"), "en");
  EXPECT_EQ(preferred("es;q=x,,;"), "en");
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

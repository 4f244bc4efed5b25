// SPDX-License-Identifier: Apache-2.0
#include "web/model/course_statistics.hpp"

#include <gtest/gtest.h>

#include "tests/unit/web/web_fixture.hpp"

namespace plumb {
namespace {

using std::chrono::minutes;

const WallClock::time_point kMorning = WallClock::now();

Scan Answer(const std::string& id, const std::string& session, double vertical_mm) {
  Scan scan;
  scan.id = id;
  scan.session_id = session;
  scan.outcome = ScanOutcome::kDone;
  scan.started_at = kMorning;
  scan.result = ResultSummary{.verdict = Verdict::kMove};
  scan.result->correction.emplace().vertical_mm = vertical_mm;
  return scan;
}

/// Newest first, as they are listed: two fractions with two scans each, and what does not count.
std::vector<Scan> Course() {
  std::vector<Scan> scans = {Answer("000006", "2", 0.5), Answer("000005", "2", -3),
                             Answer("000004", "2", 99),  Answer("000003", "1", 1),
                             Answer("000002", "1", 5),   Answer("000001", "1", 99)};
  scans[2].result->verdict = Verdict::kNoAnswer;
  scans[5].outcome = ScanOutcome::kFailed;
  scans[0].accepted_by = scans[3].accepted_by = "tess";
  scans[3].accepted_reason = "verified";
  scans[0].accepted_at = kMorning + minutes(4);
  scans[3].accepted_at = kMorning + minutes(7);
  Scan reference = Answer("000000", "0", 99);
  reference.purpose = ScanPurpose::kReference;
  scans.push_back(reference);
  return scans;
}

TEST(CourseStatisticsTest, FirstAndLastAnswersOfEachFractionAreTold) {
  const CourseStatistics course = StatisticsOf(Course());
  EXPECT_EQ(course.fractions, 2);
  EXPECT_EQ(course.scans, 4);
  EXPECT_EQ(course.accepted, 2);
  EXPECT_EQ(course.overrides, 1);
  EXPECT_DOUBLE_EQ(course.minutes.value(), 5.5);
  EXPECT_EQ(course.first[0].count, 2);
  EXPECT_DOUBLE_EQ(course.first[0].mean, 1);                             // of 5 and -3
  EXPECT_DOUBLE_EQ(course.first[0].deviation.value(), std::sqrt(32.0));  // 4 to each side
  EXPECT_DOUBLE_EQ(course.last[0].mean, 0.75);
  EXPECT_EQ(course.first[1].count, 0) << "a number that is not known does not count as 0";
  EXPECT_FALSE(course.first[1].deviation);
  EXPECT_EQ(StatisticsOf({}).fractions, 0);
}

TEST(CourseStatisticsTest, ASingleFractionHasNoDeviationAndAClockThatWasSetNoTime) {
  std::vector<Scan> scans = {Answer("000001", "1", 2)};
  scans[0].accepted_by = "tess";
  scans[0].accepted_at = kMorning - minutes(1);
  const CourseStatistics course = StatisticsOf(scans);
  EXPECT_EQ(course.first[0].count, 1);
  EXPECT_FALSE(course.first[0].deviation);
  EXPECT_FALSE(course.minutes);
}

TEST(CourseStatisticsTest, ResultsAgainstDifferentReferencesAreDifferentCourses) {
  std::vector<Scan> scans = Course();
  scans[0].reference_id = scans[1].reference_id = "8";  // of the second fraction
  for (std::size_t i = 2; i < scans.size(); ++i) scans[i].reference_id = "7";
  const std::vector<CoursePart> parts = PartsOf(scans);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].reference_id, "8") << "the one with the newest scan first";
  EXPECT_EQ(parts[0].statistics.fractions, 1);
  EXPECT_DOUBLE_EQ(parts[0].statistics.first[0].mean, -3);
  EXPECT_EQ(parts[1].reference_id, "7");
  EXPECT_EQ(parts[1].statistics.scans, 2) << "no answer and no reference scan count";
  EXPECT_DOUBLE_EQ(parts[1].statistics.first[0].mean, 5);
  EXPECT_TRUE(PartsOf({}).empty());
}

TEST(CourseStatisticsTest, AGroupHasASystematicAndARandomError) {
  const auto course = [](double mean, std::optional<double> deviation) {
    CourseStatistics one;
    one.first[0] = {.count = deviation ? 5 : 1, .mean = mean, .deviation = deviation};
    return one;
  };
  const GroupSpread group =
      GroupSpreadOf({course(1, 3), course(3, 4), course(5, {}), {}}, &CourseStatistics::first, 0);
  EXPECT_EQ(group.courses, 3);
  EXPECT_DOUBLE_EQ(group.mean, 3);
  EXPECT_DOUBLE_EQ(group.systematic.value(), 2);
  EXPECT_DOUBLE_EQ(group.random.value(), std::sqrt(12.5)) << "of those with several fractions";
  EXPECT_FALSE(GroupSpreadOf({course(1, 3)}, &CourseStatistics::first, 0).systematic);
}

class StatisticsRouteTest : public test::WebTest {
 protected:
  void AddCourse(const std::string& code, const std::string& site) {
    Patient patient;
    patient.id = code;
    patient.code = code;
    patient.site = site;
    patient.num_scans = 4;
    service_.patients.push_back(patient);
    std::vector<Scan> scans = Course();  // the fake lists the oldest first
    for (auto scan = scans.rbegin(); scan != scans.rend(); ++scan) {
      scan->patient_id = code;
      service_.scans.push_back(*scan);
    }
  }
};

TEST_F(StatisticsRouteTest, CoursesAndSitesAreListedAndExported) {
  AddCourse("P-1", "Thorax");
  AddCourse("P-2", "thorax");
  AddCourse("P-3", "=cmd");
  Start();
  SetUpAccounts();
  test::HttpClient client = LoggedIn("technician");
  const auto all = client.Get("/api/v1/statistics").json();
  ASSERT_EQ(all["courses"].size(), 3U) << all.dump();
  EXPECT_EQ(all["left_out"], 0);
  ASSERT_EQ(all["sites"].size(), 2U) << "letter case does not count";
  EXPECT_EQ(all["sites"][1]["courses"], 2);
  const auto& vertical = all["sites"][1]["numbers"][0];
  EXPECT_EQ(vertical["name"], "vertical");
  EXPECT_EQ(vertical["first"]["mean"], 1.0);
  EXPECT_EQ(vertical["first"]["systematic"], 0.0);
  EXPECT_NEAR(vertical["first"]["random"].get<double>(), std::sqrt(32.0), 1e-12);
  EXPECT_TRUE(all["sites"][1]["numbers"][1]["last"]["mean"].is_null()) << "not known, never 0";
  const auto courses = client.Get("/api/v1/patients/P-1/statistics").json()["courses"];
  ASSERT_EQ(courses.size(), 1U);
  EXPECT_EQ(courses[0]["overrides"], 1);
  EXPECT_EQ(courses[0]["numbers"][0]["last"]["mean"], 0.75);
  EXPECT_EQ(client.Get("/api/v1/patients/P-9/statistics").status, 404);
  const std::string csv = client.Get("/api/v1/statistics.csv").body;
  EXPECT_NE(csv.find("\r\ncourse,Thorax,P-1,0,1,2,4,2,1,5.5000,1.0000,5.6569,,"), csv.npos) << csv;
  EXPECT_NE(csv.find("\r\nsite,Thorax,,,2,,,,,,1.0000,0.0000,5.6569,"), csv.npos) << csv;
  EXPECT_NE(csv.find(",'=cmd,"), csv.npos) << "what a person typed is no formula";
  const std::string german = client.Get("/api/v1/statistics.csv?language=de").body;
  EXPECT_TRUE(german.starts_with("\xEF\xBB\xBFkind;site;patient;")) << german;
  EXPECT_NE(german.find("\r\ncourse;Thorax;P-1;0;1;2;4;2;1;5,5000;1,0000;5,6569;;"), csv.npos)
      << german;
}

}  // namespace
}  // namespace plumb

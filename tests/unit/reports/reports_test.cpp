// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/reports.hpp"

#include <map>
#include <utility>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <opencv2/core.hpp>

#include "daemon/files/scene_folder.hpp"
#include "daemon/records/store.hpp"
#include "daemon/reports/scan_quality.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "tests/support/process.hpp"
#include "tests/support/result_with.hpp"
#include "tests/support/synthetic_scene.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/support/test_language.hpp"
#include "words/acceptance.hpp"
#include "words/comparison.hpp"
#include "words/reconstruction.hpp"
#include "words/result.hpp"

namespace plumb {
namespace {

using test::TestLanguage;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

const Actor kAnna{.user = "anna", .address = {}};
const Actor kBob{.user = "bob", .address = {}};
const Actor kClara{.user = "clara", .address = {}};

class ReportsTest : public ::testing::Test {
 protected:
  std::string AddScan(const std::string& reference, const std::string& result,
                      DailyCheck check = {}, std::optional<double> sensor_on_s = {},
                      const std::string& stored_file = {}) {
    const std::string id = store_.scans.Begin(
        {.patient_id = patient_,
         .reference_id = reference,
         .purpose = reference.empty() ? ScanPurpose::kReference : ScanPurpose::kFraction,
         .sensor_serial = "S1",
         .reason = "",
         .sensor_on_s = sensor_on_s,
         .daily_check = check});
    std::filesystem::create_directories(store_.folders.Staging(id) / "scene");
    WriteWholeFile(store_.folders.Staging(id) / "scene/scene.json", SceneJson(scene_));
    store_.scans.Finish(id, {.outcome = ScanOutcome::kDone, .failure = {}, .result_json = result});
    if (!stored_file.empty()) {
      const std::filesystem::path folder = store_.scans.Find(id)->folder / "result";
      std::filesystem::create_directories(folder);
      WriteWholeFile(folder / "result.json", stored_file);
    }
    return id;
  }
  std::string Approved() {
    const std::string id = store_.references.Add(kAnna, AddScan("", ""), "first", {});
    ReferencePlan plan;
    plan.region_m = {{0, 0}, {0.5, 0}, {0.5, 0.4}, {0, 0.4}};
    plan.isocentre_m = {{0.45, 0.35, 0.12}};
    plan.tolerance = {.shift_mm = 2.5, .rotation_deg = 1};
    store_.references.Plan(kBob, id, 1, plan);
    const auto planned = store_.references.Find(id);
    store_.references.Approve(kClara, id, planned->revision, planned->digest);
    return id;
  }

  static Scene Swept() {
    Scene scene;
    scene.frames_total = 300;
    scene.frames_tracked = 270;
    scene.frames_dropped = 30;
    scene.keyframes.resize(40);
    return scene;
  }

  Scene scene_ = Swept();  ///< Of the next scan.
  testing::TempFolder folder_;
  Store store_{folder_.path()};
  ReportSources sources_{store_.patients, store_.references, store_.scans, /*warm_up_min=*/20};
  std::string patient_ = store_.patients.Add(kAnna, "P-0042", "thorax");
};

const std::string kMove = testing::ResultWith(
    R"({"verdict":"move","reasons":[],
        "correction":{"vertical_mm":-8.04,"longitudinal_mm":0.4,"lateral_mm":0.0,"pitch_deg":0.0,
          "roll_deg":0.0,"yaw_deg":-3.3,
          "uncertainty":{"vertical_mm":1.06,"longitudinal_mm":1.1,"lateral_mm":1.0,"pitch_deg":0.1,
            "roll_deg":0.1,"yaw_deg":0.09},
          "words":{"vertical":"down","longitudinal":"toward gantry","lateral":"to patient left",
            "pitch":"head up","roll":"patient left side down","yaw":"head to patient left"}},
        "body":{"parts":[{"words_now":"left shoulder 12 mm high",
          "words_after":"left shoulder 9 mm high"}]}})");

/// Of the first page of the report: how many pixels have the colour of what is not in tolerance.
int MarkPixels(const ScanReport& report) {
  const testing::TempFolder folder;
  WriteWholeFile(folder / "report.pdf", PdfOf(report));
  const RunResult run = Run({"/usr/bin/pdftoppm", "-png", "-r", "200", "-singlefile",
                             folder / "report.pdf", folder / "page"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  cv::Mat marked;
  cv::inRange(ReadColorImage(folder / "page.png"), cv::Scalar(138, 66, 0), cv::Scalar(158, 86, 10),
              marked);
  return cv::countNonZero(marked);
}

std::string ValueOf(const ReportFacts& facts, std::string_view name) {
  for (const auto& [key, value] : facts) {
    if (key == name) return value;
  }
  return "nothing";
}

TEST_F(ReportsTest, AReasonThatIsNoUtf8EndsNoReport) {
  const auto report_of_failure = [&](const std::string& reason) {
    const std::string id = store_.scans.Begin(
        {.patient_id = patient_, .reference_id = {}, .sensor_serial = "S1", .reason = ""});
    store_.scans.Finish(id,
                        {.outcome = ScanOutcome::kFailed, .failure = Message::Verbatim(reason)});
    return ScanReportPdf(sources_, *store_.scans.Find(id), EnglishCatalogue()).size();
  };
  const std::size_t usual = report_of_failure("cannot write /data/senal: no space");
  // What follows it is drawn too: cairo draws nothing after a text that it cannot read.
  EXPECT_GT(report_of_failure("cannot write /data/se\xF1"
                              "al: no space"),
            usual - usual / 50);
}

/// What poppler's program says of a report.
std::string ToldOf(const std::string& pdf, std::vector<std::string> program) {
  const testing::TempFolder folder;
  WriteWholeFile(folder / "report.pdf", pdf);
  program.push_back(folder / "report.pdf");
  program.emplace_back("-");
  if (program.front().ends_with("pdfinfo")) program.pop_back();
  const RunResult run = Run(program);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  return run.out;
}

TEST_F(ReportsTest, NamesOfEachScriptAreWholeAndStayOnThePage) {
  const std::string word(64, 'W');
  patient_ = store_.patients.Add(kAnna, "P-0043", "放疗科 " + word);
  const std::string id = AddScan(Approved(), kMove);
  store_.scans.Accept({.user = "张伟", .address = {}}, id, "سبب " + word + word + " 😀");
  const ReportSources& sources = sources_;
  for (const std::string& pdf :
       {ScanReportPdf(sources, *store_.scans.Find(id), EnglishCatalogue()),
        CourseReportPdf(sources, *store_.patients.Find(patient_), EnglishCatalogue())}) {
    const std::string told = ToldOf(pdf, {"/usr/bin/pdftotext", "-layout"});
    for (const char* name : {"放疗科", "张伟"}) EXPECT_THAT(told, HasSubstr(name));
    const std::string boxes = ToldOf(pdf, {"/usr/bin/pdftotext", "-bbox"});
    const std::string page = "page width=\"", right = "xMax=\"";
    const double width = std::stod(boxes.substr(boxes.find(page) + page.size()));
    int words = 0;
    for (std::size_t at = boxes.find(right); at != std::string::npos;
         at = boxes.find(right, at + 1), ++words)
      EXPECT_LE(std::stod(boxes.substr(at + right.size())), width - 42 + 1.5);
    EXPECT_GT(words, 50);
  }
}

TEST_F(ReportsTest, AReportWithTrendAndMapHasOnePageUnlessTheMapWouldBeTooSmall) {
  const std::string id = AddScan(Approved(), kMove);
  ScanReport report = DescribeScan(sources_, *store_.scans.Find(id), EnglishCatalogue());
  const CourseReport course =
      DescribeCourse(sources_, *store_.patients.Find(patient_), EnglishCatalogue());
  report.trend = {course.rows.back(), course.rows.back()};
  report.pictures.assign(2, cv::Mat(1000, 1400, CV_8UC3, cv::Scalar::all(200)));
  const auto pages = [&] {
    const std::string told = ToldOf(PdfOf(report), {"/usr/bin/pdfinfo"});
    const std::size_t at = told.find("Pages:");
    return at == std::string::npos ? 0 : std::stoi(told.substr(at + 6));
  };
  EXPECT_EQ(pages(), 1);
  report.cautions.insert(report.cautions.end(), 8, "of what there is to say a line");
  EXPECT_EQ(pages(), 2);
}

TEST_F(ReportsTest, ReportsAreMadeForThePaperOfTheUnit) {
  const std::string id = AddScan(Approved(), kMove);
  const auto size_of = [&](const std::string& pdf) {
    const std::string told = ToldOf(pdf, {"/usr/bin/pdfinfo"});
    const std::size_t at = told.find("Page size:");
    return told.substr(at, told.find('\n', at) - at);
  };
  const auto scan = [&] {
    return ScanReportPdf(sources_, *store_.scans.Find(id), EnglishCatalogue());
  };
  const auto course = [&] {
    return CourseReportPdf(sources_, *store_.patients.Find(patient_), EnglishCatalogue());
  };
  EXPECT_THAT(size_of(scan()), HasSubstr("595.276 x 841.89 pts (A4)"));
  EXPECT_THAT(size_of(course()), HasSubstr("841.89 x 595.276 pts (A4)"));
  sources_.paper = "Letter";
  EXPECT_THAT(size_of(scan()), HasSubstr("612 x 792 pts (letter)"));
  EXPECT_THAT(size_of(course()), HasSubstr("792 x 612 pts (letter)"));
}

TEST_F(ReportsTest, NumbersAreThoseOfTheCouchAndRecordsStayAsTheyAre) {
  const std::string id = AddScan(Approved(), kMove, DailyCheck::kPassed);
  const Scan scan = *store_.scans.Find(id);
  sources_.couch = {.version = 1,
                    .name = "Couch 2",
                    .num_axes = 3,
                    .is_in_cm = true,
                    .reverses = {true, false, false, false, false, false}};
  const ScanReport report = DescribeScan(sources_, scan, EnglishCatalogue());
  ASSERT_THAT(report.numbers, SizeIs(6));
  EXPECT_DOUBLE_EQ(*report.numbers[0].value, 0.804);
  EXPECT_EQ(report.numbers[0].way.English(), "down");
  EXPECT_EQ(report.numbers[5].way.English(), "not by the couch: move the patient");
  EXPECT_EQ(report.verdict, "MOVE");
  EXPECT_THAT(report.couch, SizeIs(3));
  EXPECT_THAT(report.couch[0], HasSubstr("Couch 2"));
  const CourseReport course =
      DescribeCourse(sources_, *store_.patients.Find(patient_), EnglishCatalogue());
  ASSERT_THAT(course.rows, SizeIs(2)) << "the reference, too";
  EXPECT_DOUBLE_EQ(course.rows[1].values[0]->value, -8.04) << "records are in mm of IEC 61217";
  EXPECT_GT(ScanReportPdf(sources_, scan, EnglishCatalogue()).size(), 1000U);
}

TEST_F(ReportsTest, AScanIsToldInTheLanguageThatIsAskedFor) {
  const std::string id = AddScan(Approved(), kMove, DailyCheck::kOverdue);
  const Scan scan = *store_.scans.Find(id);
  const ScanReport english = DescribeScan(sources_, scan, EnglishCatalogue());
  const ScanReport other = DescribeScan(sources_, scan, TestLanguage());
  EXPECT_EQ(english.verdict, "MOVE");
  EXPECT_EQ(other.verdict, "<result.report_verdict_move>");
  EXPECT_EQ(other.language, &TestLanguage());
  ASSERT_THAT(other.numbers, SizeIs(6));
  EXPECT_EQ(Text(english.numbers[0].way, EnglishCatalogue()), "down");
  EXPECT_EQ(Text(other.numbers[1].way, TestLanguage()), "<result.page_no_change>");
  EXPECT_THAT(english.cautions, ElementsAre("10 % of the frames were lost.",
                                            "The daily check was overdue at this scan."));
  EXPECT_THAT(other.cautions, ElementsAre("<result.report_frames_lost 10 %>", "<result.overdue>"));
  EXPECT_EQ(ValueOf(other.identity, "<result.report_isocentre>"), "x 0,450; y 0,350; z 0,120 m");
  EXPECT_EQ(ValueOf(english.identity, "Region"), "4 corners, 2000 cm\u00b2");
  EXPECT_EQ(ValueOf(other.identity, "<result.report_region>"), "<result.report_corners 4 2000>");
  EXPECT_EQ(ValueOf(other.identity, "<result.report_tolerance_fact>"),
            "\u00b12,5 mm, \u00b11\u00b0");
  EXPECT_EQ(ValueOf(english.identity, "Plan"), "head first, supine, markers fixed to the room");
  EXPECT_THAT(ValueOf(english.identity, "Approved by"), HasSubstr("clara"));
  // Nothing of one language is left in the other.
  for (std::size_t i = 0; i < english.identity.size(); ++i) {
    EXPECT_NE(english.identity[i].first, other.identity[i].first);
  }
  EXPECT_TRUE(PdfOf(other).starts_with("%PDF-"));
}

TEST_F(ReportsTest, ASensorThatWasOnForLessThanTheConfiguredTimeIsACaution) {
  const auto cautions = [&](double sensor_on_s) {
    const std::string id = AddScan("", "", DailyCheck::kPassed, sensor_on_s);
    return DescribeScan(sources_, *store_.scans.Find(id), EnglishCatalogue()).cautions;
  };
  // 20 min are configured.
  const std::string warming = "was still warming up.";
  EXPECT_THAT(cautions(1199),
              ::testing::Contains("The sensor had been on for only 19 min and " + warming));
  EXPECT_THAT(cautions(1200), Not(::testing::Contains(HasSubstr(warming))));
}

TEST_F(ReportsTest, AResultOfMoreThanHalfLostFramesCannotBeAccepted) {
  ScanFiles files{.scene = StoredScene{}, .result = {}, .unreadable = {}};
  files.scene->scene.frames_total = 200;
  const auto why_not = [&](std::int64_t lost) {
    files.scene->scene.frames_dropped = lost;
    return QualityOf(Scan{}, files, 20).why_not_accept;
  };
  EXPECT_EQ(why_not(100).English(), "");
  EXPECT_THAT(why_not(101).English(), HasSubstr("50.5 % of the frames were lost, more than 50 %"));
}

TEST_F(ReportsTest, EachIgnoredMarkerIsACaution) {
  const std::string id = AddScan(
      Approved(), kMove, DailyCheck::kPassed, {},
      testing::ResultWith(
          R"({"verdict":"move","alignment":{"markers_rejected":{"7":0.0121,"31":0.0306}}})"));
  const Scan scan = *store_.scans.Find(id);
  EXPECT_THAT(DescribeScan(sources_, scan, EnglishCatalogue()).cautions,
              ::testing::IsSupersetOf({"Marker 7 was ignored: it moved 12 mm.",
                                       "Marker 31 was ignored: it moved 31 mm."}));
}

TEST_F(ReportsTest, AWarningOfTheScanThatItsComparisonRepeatsIsSaidOnce) {
  const Message busy = say::reconstruction::NoImage(1.5), lone = say::reconstruction::NoMarker();
  ScanFiles files{.scene = StoredScene{}, .result = StoredResult{}, .unreadable = {}};
  const Message repeated = say::comparison::ScanWarned(say::acceptance::ScanCurrent(), busy);
  const Message other = say::comparison::ScanWarned(say::acceptance::ScanReference(), busy);
  files.result->warnings = {other, repeated};
  files.scene->scene.warnings = {busy, lone};
  EXPECT_THAT(QualityOf(Scan{}, files, 20).remarks,
              ::testing::IsSupersetOf({other, repeated, lone}));
  EXPECT_THAT(QualityOf(Scan{}, files, 20).remarks, Not(::testing::Contains(busy)));
}

TEST_F(ReportsTest, ARowThatIsWorseThanItShouldBeIsACaution) {
  const auto rows = [&](const std::string& result) {
    const std::string id =
        AddScan(Approved(), kMove, DailyCheck::kPassed, {}, testing::ResultWith(result));
    const Scan scan = *store_.scans.Find(id);
    std::map<std::string, std::pair<std::string, bool>> said;
    for (const auto& [name, value, is_caution] : QualityOf(scan, FilesOf(scan), 20).rows)
      said[Text(name, EnglishCatalogue())] = {Text(value, EnglishCatalogue()), is_caution};
    return said;
  };
  const auto region = [](double coverage, double hole_m) {
    return fmt::format(
        R"({{"verdict":"move","region":{{"coverage":{},"largest_hole_m":{},"min_coverage":0.9,)"
        R"("max_hole_m":0.05}}}})",
        coverage, hole_m);
  };
  using Row = std::pair<std::string, bool>;
  auto good = rows(region(0.9, 0.05));
  EXPECT_EQ(good["Region covered"], Row("90.0 %", false));
  EXPECT_EQ(good["Largest hole"], Row("50 mm", false));
  EXPECT_EQ(good["Frames tracked"], Row("270 of 300", false));
  EXPECT_EQ(good["Frames lost"], Row("30 (10 %)", true));
  EXPECT_EQ(good["Images used"], Row("40", false));
  auto bad = rows(region(0.899, 0.051));
  EXPECT_EQ(bad["Region covered"], Row("89.9 %", true));
  EXPECT_EQ(bad["Largest hole"], Row("51 mm", true));
  scene_.frames_dropped = 14;
  scene_.longest_lost_s = 0.72;
  scene_.calibration["depth_scale"] = 0.9954;
  auto few = rows(region(0.9, 0.05));
  EXPECT_EQ(few["Frames lost"], Row("14 (5 %)", false)) << "4.7 %";
  EXPECT_EQ(few["Longest gap"], Row("0.7 s", true));
  EXPECT_EQ(few["Correction of the sensor's depth"], Row("-0.46 %", false));
}

TEST_F(ReportsTest, ASceneThatCannotBeReadIsSaidAndNotUsed) {
  const std::string id = AddScan(Approved(), kMove);
  const Scan scan = *store_.scans.Find(id);
  WriteWholeFile(scan.folder / "scene/scene.json", R"({"format":1,"preset":"best"})");
  const web::ScanQuality quality = QualityOf(scan, FilesOf(scan), 20);
  EXPECT_THAT(EnglishTexts(quality.remarks),
              ::testing::Contains(HasSubstr("scene.json: frame is missing")));
  for (const web::QualityRow& row : quality.rows)
    EXPECT_FALSE(row.name.Is(say::result::kQualityTracked));
}

TEST_F(ReportsTest, WithoutAKnownRoomTheNumbersAreNamedAfterThePatientAndNotTheCouch) {
  const auto names_in = [&](const std::string& body,
                            const Catalogue& language = EnglishCatalogue()) {
    nlohmann::json result = nlohmann::json::parse(kMove);
    result["motion"]["weak_directions"] = {{{"name", "lateral"}}};
    result["body"].merge_patch(nlohmann::json::parse(body));
    const std::string text = testing::ResultWith(result.dump());
    const Scan scan = *store_.scans.Find(AddScan(Approved(), text, DailyCheck::kPassed, {}, text));
    const ScanReport report = DescribeScan(sources_, scan, language);
    std::vector<std::string> names;
    for (const CouchRow& row : report.numbers) names.push_back(Text(row.judged.name, language));
    EXPECT_THAT(report.cautions, ::testing::Contains(HasSubstr(names.at(2))));
    return names;
  };
  EXPECT_THAT(names_in(R"({"room_known":true,"head_xy":[1,0],"left_xy":[0,1]})"),
              ElementsAre("Vertical", "Longitudinal", "Lateral", "Pitch", "Roll", "Yaw"));
  EXPECT_THAT(names_in(R"({"room_known":false,"head_xy":[0.2,0.98],"left_xy":[0.98,-0.2]})"),
              ElementsAre("Vertical", "Patient head/feet", "Patient left/right", "Tilt head/feet",
                          "Tilt left/right", "Yaw"));
  EXPECT_THAT(names_in(R"({"room_known":false,"head_xy":[-1,0],"left_xy":[0,1]})"),
              ElementsAre("Vertical", "Patient left/right", "Patient head/feet", "Tilt left/right",
                          "Tilt head/feet", "Yaw"));
  // Both of the sides lie near each axis, or are not known.
  for (const char* body : {R"({"room_known":false,"head_xy":[0.7,0.7],"left_xy":[0.7,-0.7]})",
                           R"({"room_known":false})"}) {
    EXPECT_THAT(names_in(body), ElementsAre("Vertical", "Along marker Y", "Along marker X",
                                            "Tilt along marker Y", "Tilt along marker X", "Yaw"));
  }
  EXPECT_THAT(names_in(R"({"room_known":false,"head_xy":[0,1],"left_xy":[1,0]})", TestLanguage()),
              ElementsAre("<result.axis_vertical>", "<result.line_head>", "<result.line_left>",
                          "<result.tilt_head>", "<result.tilt_left>", "<result.axis_yaw>"));
}

TEST_F(ReportsTest, AResultFileThatContradictsItselfIsNamedAndNotUsed) {
  nlohmann::json file = nlohmann::json::parse(kMove);
  file["verdict"] = "in_tolerance";
  file["alignment"] = nullptr;
  const std::string id = AddScan(Approved(), kMove, DailyCheck::kPassed, {}, file.dump());
  const ScanReport report = DescribeScan(sources_, *store_.scans.Find(id), EnglishCatalogue());
  EXPECT_THAT(report.cautions, ::testing::Contains(HasSubstr("in_tolerance, but the numbers")));
  EXPECT_EQ(ValueOf(report.quality, "Computed with"), "nothing");
}

TEST_F(ReportsTest, NoAnswerGivesItsReasonAndNoNumbers) {
  const std::string id = AddScan(
      Approved(),
      testing::ResultWith(
          R"({"verdict":"no_answer","reasons":["the current scan covers 81.5 % of the region, at least 90 % are needed; sweep all of it"],
          "correction":{"vertical_mm":-8.04,"longitudinal_mm":0.4,"lateral_mm":0.0,"pitch_deg":0.0,"roll_deg":0.0,"yaw_deg":0.0}})"));
  const ScanReport report = DescribeScan(sources_, *store_.scans.Find(id), TestLanguage());
  EXPECT_EQ(report.verdict, "<result.no_answer>");
  EXPECT_THAT(report.why, HasSubstr("81.5 %")) << "stored without an id: as it was";
  EXPECT_TRUE(report.numbers.empty());
  EXPECT_TRUE(report.body.empty());
}

TEST_F(ReportsTest, AScanForAReferenceNamesThePlanThatWasMadeOfItAndWhoApprovedIt) {
  const std::string loose = AddScan("", "");
  EXPECT_EQ(ValueOf(DescribeScan(sources_, *store_.scans.Find(loose), EnglishCatalogue()).identity,
                    "Approved by"),
            "nothing");
  const std::string draft = store_.references.Add(kAnna, loose, "first", {});
  const std::string before =
      ValueOf(DescribeScan(sources_, *store_.scans.Find(loose), EnglishCatalogue()).identity,
              "Approved by");
  EXPECT_THAT(before, Not(HasSubstr("clara")));
  EXPECT_NE(before, "nothing");
  const std::string approved = Approved();
  const Scan scan = *store_.scans.Find(store_.references.Find(approved)->scan_id);
  const ScanReport report = DescribeScan(sources_, scan, EnglishCatalogue());
  EXPECT_THAT(ValueOf(report.identity, "Approved by"), HasSubstr("clara, 20"));
  EXPECT_EQ(ValueOf(report.identity, "Plan"), "head first, supine, markers fixed to the room");
  // Each scan its own: the other one's draft is still not approved.
  EXPECT_EQ(ValueOf(DescribeScan(sources_, *store_.scans.Find(loose), EnglishCatalogue()).identity,
                    "Approved by"),
            before);
  EXPECT_TRUE(PdfOf(report).starts_with("%PDF-"));
}

TEST_F(ReportsTest, ThePictureOfAPlanThatNamesSidesAsksWhetherThePatientLiesSo) {
  const Scan scan = *store_.scans.Find(store_.references.Find(Approved())->scan_id);
  WriteScene(test::MakeSyntheticScene({}), scan.folder / "scene");
  const ScanReport unknown = DescribeScan(sources_, scan, EnglishCatalogue());
  EXPECT_THAT(unknown.pictures, SizeIs(1));
  EXPECT_EQ(unknown.pictures_note, "") << "no side is named";
  sources_.room_in = [](const MarkerMap&) { return RoomWays{}; };
  const ScanReport english = DescribeScan(sources_, scan, EnglishCatalogue());
  EXPECT_THAT(english.pictures, SizeIs(1));
  EXPECT_THAT(english.pictures_note, HasSubstr("check that the patient lies so"));
  EXPECT_THAT(DescribeScan(sources_, scan, TestLanguage()).pictures_note,
              "<result.report_planned_sides>");
  ScanReport without = english;
  without.pictures_note.clear();
  EXPECT_GT(PdfOf(english).size(), PdfOf(without).size()) << "it is printed";
}

TEST_F(ReportsTest, ACourseNamesItsReferenceAndWhoAcceptedWhat) {
  const std::string reference = Approved();
  const std::string id = AddScan(reference, kMove);
  store_.scans.Accept(kAnna, id, "the arm cannot be moved");
  const CourseReport course =
      DescribeCourse(sources_, *store_.patients.Find(patient_), TestLanguage());
  ASSERT_THAT(course.rows, SizeIs(2));
  EXPECT_EQ(course.rows[0].verdict, "<result.report_verdict_reference>");
  EXPECT_THAT(course.rows[1].accepted,
              ::testing::MatchesRegex("<result.report_accepted_outside anna, "
                                      "20[0-9-]+ [0-9:]+ UTC the arm cannot be moved>"));
  ASSERT_TRUE(course.rows[1].values[0]);
  EXPECT_EQ(course.rows[1].values[0]->u95, 1.06);
  const std::string unsure_id = AddScan(reference, testing::ResultWith(R"({"verdict":"unsure"})"));
  store_.scans.Accept(kAnna, unsure_id, "as yesterday");
  EXPECT_THAT(DescribeCourse(sources_, *store_.patients.Find(patient_), EnglishCatalogue())
                  .rows.back()
                  .accepted,
              HasSubstr("although inconclusive, by anna"));
  EXPECT_EQ(ValueOf(course.identity, "<result.report_first_scans>"), "nothing") << "one answer";
  const std::string other = AddScan(reference, kMove);
  EXPECT_THAT(
      ValueOf(
          DescribeCourse(sources_, *store_.patients.Find(patient_), EnglishCatalogue()).identity,
          "First scan of a fraction: mean \u00b1 SD"),
      HasSubstr(" \u00b1 0.0;"));
  EXPECT_THAT(ValueOf(course.identity, "<result.report_approved_by>"), HasSubstr("clara"));
  EXPECT_EQ(ValueOf(course.identity, "<result.report_failed_mark>"), "nothing");
  const std::string failed = AddScan("", "", DailyCheck::kFailed);
  EXPECT_THAT(DescribeScan(sources_, *store_.scans.Find(failed), EnglishCatalogue()).cautions,
              ::testing::Contains("The daily check had failed before this scan."));
  const CourseReport marked =
      DescribeCourse(sources_, *store_.patients.Find(patient_), TestLanguage());
  EXPECT_EQ(marked.rows.back().verdict, "<result.report_verdict_reference> **");
  EXPECT_EQ(ValueOf(marked.identity, "<result.report_failed_mark>"),
            "<result.report_failed_words>");
  EXPECT_TRUE(PdfOf(course).starts_with("%PDF-"));
}

TEST_F(ReportsTest, AnAbsentUncertaintyOrCoverageIsNotKnownAndNotZero) {
  std::string without = kMove;
  const std::string known = R"("vertical_mm":1.06,)";
  without.erase(without.find(known), known.size());
  nlohmann::json file = nlohmann::json::parse(
      testing::ResultWith(R"({"verdict":"move","alignment":{},"region":{}})"));
  file["alignment"]["rms_m"] = nullptr;  // as what is not finite is written
  file["region"]["coverage"] = file["region"]["largest_hole_m"] = nullptr;
  const std::string id = AddScan(Approved(), without, DailyCheck::kPassed, {}, file.dump());
  const Scan scan = *store_.scans.Find(id);
  const ScanReport report = DescribeScan(sources_, scan, EnglishCatalogue());
  ASSERT_THAT(report.numbers, SizeIs(6));
  EXPECT_EQ(report.numbers[0].u95, std::nullopt);
  EXPECT_EQ(report.numbers[1].u95, 1.1);
  for (const char* name : {"Marker misfit", "Region covered", "Largest hole"})
    EXPECT_EQ(ValueOf(report.quality, name), "not known") << name;
  const CourseReport course =
      DescribeCourse(sources_, *store_.patients.Find(patient_), EnglishCatalogue());
  ASSERT_TRUE(course.rows.back().values[0]);
  EXPECT_EQ(course.rows.back().values[0]->u95, std::nullopt);
  EXPECT_TRUE(PdfOf(report).starts_with("%PDF-"));

  // A dot of an unknown interval is a ring without a line, in the bar and in the trend.
  ScanReport drawn;
  drawn.title = "t";
  drawn.verdict = "v";
  drawn.numbers = {report.numbers[1]};
  drawn.numbers[0].judged.judgement = NumberJudgement::kUnjudged;
  CourseRow row;
  row.values[0] = CourseValue{1.0, 0.9, NumberJudgement::kUnjudged};
  drawn.trend = {row, row};
  const int with_interval = MarkPixels(drawn);
  drawn.numbers[0].u95 = std::nullopt;
  const int bar_unknown = MarkPixels(drawn);
  EXPECT_LT(bar_unknown, with_interval - 10);
  for (CourseRow& one : drawn.trend) one.values[0]->u95 = std::nullopt;
  EXPECT_LT(MarkPixels(drawn), bar_unknown - 10);
}

}  // namespace
}  // namespace plumb

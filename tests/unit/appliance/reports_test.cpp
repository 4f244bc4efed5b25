#include "daemon/appliance/reports.hpp"

#include <gmock/gmock.h>

#include "daemon/appliance/report_words.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/records/store.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/synthetic_scene.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using web::Language;

const Actor kAnna{.user = "anna", .address = {}};
const Actor kBob{.user = "bob", .address = {}};
const Actor kClara{.user = "clara", .address = {}};

class ReportsTest : public ::testing::Test {
 protected:
  std::string AddScan(const std::string& reference, const std::string& result,
                      DailyCheck check = {}, std::optional<double> sensor_on_s = {},
                      const std::string& result_file = {}) {
    const std::string id = store_.scans.Begin(
        {.patient_id = patient_,
         .reference_id = reference,
         .purpose = reference.empty() ? ScanPurpose::kReference : ScanPurpose::kFraction,
         .sensor_serial = "S1",
         .reason = "",
         .sensor_on_s = sensor_on_s,
         .daily_check = check});
    std::filesystem::create_directories(store_.folders.Staging(id) / "scene");
    WriteWholeFile(store_.folders.Staging(id) / "scene/scene.json",
                   R"({"frames":{"total":300,"tracked":270,"dropped":30},"keyframes":40})");
    if (!result_file.empty()) {
      std::filesystem::create_directories(store_.folders.Staging(id) / "result");
      WriteWholeFile(store_.folders.Staging(id) / "result/result.json", result_file);
    }
    store_.scans.Finish(id, {.outcome = ScanOutcome::kDone, .failure = "", .result_json = result});
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

  testing::TempFolder folder_;
  Store store_{folder_.path()};
  ReportSources sources_{store_.patients, store_.references, store_.scans, /*warm_up_min=*/20};
  std::string patient_ = store_.patients.Add(kAnna, "P-0042", "thorax");
};

constexpr const char* kMove =
    R"({"verdict":"move","reasons":[],
        "correction":{"vertical_mm":-8.04,"longitudinal_mm":0.4,"lateral_mm":0.0,"pitch_deg":0.0,
          "roll_deg":0.0,"yaw_deg":-3.3,
          "uncertainty":{"vertical_mm":1.06,"longitudinal_mm":1.1,"lateral_mm":1.0,"pitch_deg":0.1,
            "roll_deg":0.1,"yaw_deg":0.09},
          "words":{"vertical":"down","longitudinal":"toward gantry","lateral":"to patient left",
            "pitch":"head up","roll":"patient left side down","yaw":"head to patient left"}},
        "body":{"parts":[{"words_now":"left shoulder 12 mm high",
          "words_after":"left shoulder 9 mm high"}]}})";

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
    store_.scans.Finish(id, {.outcome = ScanOutcome::kFailed, .failure = reason});
    return ScanReportPdf(sources_, *store_.scans.Find(id), Language::kEnglish).size();
  };
  const std::size_t usual = report_of_failure("cannot write /data/senal: no space");
  // What follows it is drawn too: cairo draws nothing after a text that it cannot read.
  EXPECT_GT(report_of_failure("cannot write /data/se\xF1"
                              "al: no space"),
            usual - usual / 50);
}

TEST_F(ReportsTest, AScanIsToldInTheLanguageThatIsAskedFor) {
  const std::string id = AddScan(Approved(), kMove, DailyCheck::kOverdue);
  const Scan scan = *store_.scans.Find(id);
  const ScanReport english = DescribeScan(sources_, scan, Language::kEnglish);
  const ScanReport spanish = DescribeScan(sources_, scan, Language::kSpanish);
  EXPECT_EQ(english.verdict, "MOVE");
  EXPECT_EQ(spanish.verdict, "MOVER");
  EXPECT_THAT(spanish.texts.notice, HasSubstr("Solo para investigación"));
  ASSERT_THAT(spanish.numbers, SizeIs(6));
  EXPECT_EQ(english.numbers[0].words, "down");
  EXPECT_EQ(spanish.numbers[0].words, "abajo");
  EXPECT_EQ(spanish.numbers[1].words, "menor que su incertidumbre");
  EXPECT_EQ(spanish.numbers[5].words, "cabeza hacia la izquierda del paciente");
  EXPECT_THAT(spanish.body, ElementsAre("hombro izquierdo: 9 mm demasiado alto"));
  EXPECT_THAT(spanish.cautions, ElementsAre("Se perdió el 10 % de las imágenes.",
                                            "El control diario estaba pendiente en este escaneo."));
  EXPECT_EQ(ValueOf(spanish.identity, "Isocentro"), "x 0,450; y 0,350; z 0,120 m");
  EXPECT_EQ(ValueOf(spanish.identity, "Región"), "4 vértices, 2000 cm\u00b2");
  EXPECT_EQ(ValueOf(spanish.identity, "Tolerancia"), "\u00b12,5 mm, \u00b11\u00b0");
  EXPECT_EQ(ValueOf(english.identity, "Plan"), "head first, supine, markers fixed to the room");
  EXPECT_THAT(ValueOf(english.identity, "Approved by"), HasSubstr("clara"));
  // Nothing of one language is left in the other.
  for (std::size_t i = 0; i < english.identity.size(); ++i) {
    if (english.identity[i].first == "Plan") continue;
    EXPECT_NE(english.identity[i].first, spanish.identity[i].first);
  }
  EXPECT_TRUE(PdfOf(spanish).starts_with("%PDF-"));
}

TEST_F(ReportsTest, ASensorThatWasOnForLessThanTheConfiguredTimeIsACaution) {
  const auto cautions = [&](double sensor_on_s) {
    const std::string id = AddScan("", "", DailyCheck::kPassed, sensor_on_s);
    return DescribeScan(sources_, *store_.scans.Find(id), Language::kEnglish).cautions;
  };
  // 20 min are configured.
  EXPECT_THAT(cautions(1199), ::testing::Contains("The sensor was still warming up."));
  EXPECT_THAT(cautions(1200), Not(::testing::Contains("The sensor was still warming up.")));
}

TEST_F(ReportsTest, EachIgnoredMarkerIsACaution) {
  const std::string id = AddScan(Approved(), kMove, DailyCheck::kPassed, {},
                                 R"({"alignment":{"markers_rejected":{"7":0.0121,"31":0.0306}}})");
  const Scan scan = *store_.scans.Find(id);
  EXPECT_THAT(NotesOf(sources_, scan, Language::kEnglish).cautions,
              ::testing::IsSupersetOf({"Marker 7 was ignored: it moved 12 mm.",
                                       "Marker 31 was ignored: it moved 31 mm."}));
}

TEST_F(ReportsTest, WithoutAKnownRoomTheNumbersAreNamedAfterThePatientAndNotTheCouch) {
  const auto names_in = [&](const std::string& body, Language language = Language::kEnglish) {
    const std::string id =
        AddScan(Approved(), kMove, DailyCheck::kPassed, {},
                R"({"motion":{"weak_directions":[{"name":"lateral"}]},"body":)" + body + "}");
    const Scan scan = *store_.scans.Find(id);
    const web::ResultNotes notes = NotesOf(sources_, scan, language);
    const ScanReport report = DescribeScan(sources_, scan, language);
    EXPECT_EQ(report.cautions, notes.cautions);
    for (std::size_t i = 0; i < notes.axes.size(); ++i)
      EXPECT_EQ(report.numbers[i].name, notes.axes[i]);
    EXPECT_THAT(notes.cautions, ::testing::Contains(HasSubstr(notes.axes[2])));
    return notes.axes;
  };
  EXPECT_THAT(names_in(R"({"room_known":true,"head_xy":[1,0],"left_xy":[0,1]})"),
              ElementsAre("Vertical", "Longitudinal", "Lateral", "Pitch", "Roll", "Yaw"));
  EXPECT_THAT(names_in(R"({"room_known":false,"head_xy":[0.2,0.98],"left_xy":[0.98,-0.2]})"),
              ElementsAre("Vertical", "Patient head/feet", "Patient left/right", "Tilt head/feet",
                          "Tilt left/right", "Yaw"));
  EXPECT_THAT(names_in(R"({"room_known":false,"head_xy":[-1,0],"left_xy":[0,1]})"),
              ElementsAre("Vertical", "Patient left/right", "Patient head/feet", "Tilt left/right",
                          "Tilt head/feet", "Yaw"));
  // Both of the sides lie near each axis, are not known, or are damaged.
  for (const char* body :
       {R"({"room_known":false,"head_xy":[0.7,0.7],"left_xy":[0.7,-0.7]})",
        R"({"room_known":false})", R"({"room_known":false,"head_xy":["1","0"],"left_xy":[0]})"}) {
    EXPECT_THAT(names_in(body), ElementsAre("Vertical", "Along marker Y", "Along marker X",
                                            "Tilt along marker Y", "Tilt along marker X", "Yaw"));
  }
  EXPECT_THAT(
      names_in(R"({"room_known":false,"head_xy":[0,1],"left_xy":[1,0]})", Language::kSpanish),
      ElementsAre("Vertical", "Paciente: cabeza/pies", "Paciente: izq./der.",
                  "Inclinación cabeza/pies", "Inclinación izq./der.", "Guiñada"));
}

TEST_F(ReportsTest, NoAnswerGivesItsReasonAndNoNumbers) {
  const std::string id = AddScan(
      Approved(),
      R"({"verdict":"no_answer","reasons":["the current scan covers 81.5 % of the region, at least 90 % are needed; sweep all of it"],
          "correction":{"vertical_mm":-8.04,"longitudinal_mm":0.4,"lateral_mm":0.0,"pitch_deg":0.0,"roll_deg":0.0,"yaw_deg":0.0}})");
  const ScanReport report = DescribeScan(sources_, *store_.scans.Find(id), Language::kSpanish);
  EXPECT_EQ(report.verdict, "SIN RESPUESTA");
  EXPECT_EQ(report.why,
            "el escaneo actual cubre el 81,5 % de la región y se necesita al menos el 90 %; "
            "bárrala toda");
  EXPECT_TRUE(report.numbers.empty());
  EXPECT_TRUE(report.body.empty());
}

TEST_F(ReportsTest, AScanForAReferenceNamesThePlanThatWasMadeOfItAndWhoApprovedIt) {
  const std::string loose = AddScan("", "");
  EXPECT_EQ(ValueOf(DescribeScan(sources_, *store_.scans.Find(loose), Language::kEnglish).identity,
                    "Approved by"),
            "nothing");
  const std::string draft = store_.references.Add(kAnna, loose, "first", {});
  const std::string before =
      ValueOf(DescribeScan(sources_, *store_.scans.Find(loose), Language::kEnglish).identity,
              "Approved by");
  EXPECT_THAT(before, Not(HasSubstr("clara")));
  EXPECT_NE(before, "nothing");
  const std::string approved = Approved();
  const Scan scan = *store_.scans.Find(store_.references.Find(approved)->scan_id);
  const ScanReport report = DescribeScan(sources_, scan, Language::kEnglish);
  EXPECT_THAT(ValueOf(report.identity, "Approved by"), HasSubstr("clara, 20"));
  EXPECT_EQ(ValueOf(report.identity, "Plan"), "head first, supine, markers fixed to the room");
  // Each scan its own: the other one's draft is still not approved.
  EXPECT_EQ(ValueOf(DescribeScan(sources_, *store_.scans.Find(loose), Language::kEnglish).identity,
                    "Approved by"),
            before);
  EXPECT_TRUE(PdfOf(report).starts_with("%PDF-"));
}

TEST_F(ReportsTest, ThePictureOfAPlanThatNamesSidesAsksWhetherThePatientLiesSo) {
  const Scan scan = *store_.scans.Find(store_.references.Find(Approved())->scan_id);
  WriteScene(test::MakeSyntheticScene({}), scan.folder / "scene");
  const ScanReport unknown = DescribeScan(sources_, scan, Language::kEnglish);
  EXPECT_THAT(unknown.pictures, SizeIs(1));
  EXPECT_EQ(unknown.pictures_note, "") << "no side is named";
  sources_.room_in = [](const MarkerMap&) { return RoomWays{}; };
  const ScanReport english = DescribeScan(sources_, scan, Language::kEnglish);
  EXPECT_THAT(english.pictures, SizeIs(1));
  EXPECT_THAT(english.pictures_note, HasSubstr("check that the patient lies so"));
  EXPECT_THAT(DescribeScan(sources_, scan, Language::kSpanish).pictures_note,
              HasSubstr("compruebe que el paciente está así"));
  ScanReport without = english;
  without.pictures_note.clear();
  EXPECT_GT(PdfOf(english).size(), PdfOf(without).size()) << "it is printed";
}

TEST_F(ReportsTest, ACourseNamesItsReferenceAndWhoAcceptedWhat) {
  const std::string id = AddScan(Approved(), kMove);
  store_.scans.Accept(kAnna, id, "the arm cannot be moved");
  const CourseReport course =
      DescribeCourse(sources_, *store_.patients.Find(patient_), Language::kSpanish);
  ASSERT_THAT(course.rows, SizeIs(2));
  EXPECT_EQ(course.rows[0].verdict, "REFERENCIA");
  EXPECT_THAT(course.rows[1].accepted,
              ::testing::MatchesRegex("fuera de tolerancia por anna, "
                                      "20[0-9-]+ [0-9:]+ UTC: the arm cannot be moved"));
  ASSERT_TRUE(course.rows[1].values[0]);
  EXPECT_EQ(course.rows[1].values[0]->u95, 1.06);
  std::string unsure = kMove;
  unsure.replace(unsure.find("move"), 4, "unsure");
  const std::string unsure_id = AddScan(Approved(), unsure);
  store_.scans.Accept(kAnna, unsure_id, "as yesterday");
  EXPECT_THAT(DescribeCourse(sources_, *store_.patients.Find(patient_), Language::kEnglish)
                  .rows.back()
                  .accepted,
              HasSubstr("although not surely within tolerance by anna"));
  EXPECT_THAT(ValueOf(course.identity, "Aprobado por"), HasSubstr("clara"));
  EXPECT_EQ(ValueOf(course.identity, "** Control diario"), "nothing");
  const std::string failed = AddScan("", "", DailyCheck::kFailed);
  EXPECT_THAT(DescribeScan(sources_, *store_.scans.Find(failed), Language::kEnglish).cautions,
              ::testing::Contains("The daily check had failed before this scan."));
  const CourseReport marked =
      DescribeCourse(sources_, *store_.patients.Find(patient_), Language::kSpanish);
  EXPECT_EQ(marked.rows.back().verdict, "REFERENCIA **");
  EXPECT_EQ(ValueOf(marked.identity, "** Control diario"), "no superado antes de este escaneo");
  EXPECT_TRUE(PdfOf(course).starts_with("%PDF-"));
}

TEST(ReportWords, WhatHasNoWordsStaysAsItIs) {
  EXPECT_EQ(Translated("something else", Language::kSpanish), "something else");
  EXPECT_EQ(Translated("", Language::kSpanish), "");
  const std::string bomb(100000, 'a');
  EXPECT_EQ(Translated(bomb + " 3 mm high", Language::kSpanish), bomb + " 3 mm high");
  EXPECT_EQ(Translated("marker 7 moved 12.5 mm", Language::kSpanish),
            "el marcador 7 se movió 12,5 mm");
}

}  // namespace
}  // namespace plumb

// SPDX-License-Identifier: Apache-2.0
// Archives read back by the library and, from outside, what a browser gets of a course.
#include "web/exchange/zip_archive.hpp"

#include <gmock/gmock.h>
#include <zip.h>

#include <fstream>
#include <map>
#include <memory>

#include "algo/base/errors.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/web/web_fixture.hpp"

namespace plumb::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Key;

/// What an archive holds, by name.
std::map<std::string, std::string> Unzipped(const std::string& bytes) {
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* const source = zip_source_buffer_create(bytes.data(), bytes.size(), 0, &error);
  const std::unique_ptr<zip_t, decltype(&zip_discard)> archive(
      zip_open_from_source(source, ZIP_RDONLY | ZIP_CHECKCONS, &error), &zip_discard);
  EXPECT_TRUE(archive) << zip_error_strerror(&error);
  std::map<std::string, std::string> files;
  if (!archive) return files;
  for (zip_int64_t i = 0; i < zip_get_num_entries(archive.get(), 0); ++i) {
    zip_stat_t stat;
    EXPECT_EQ(zip_stat_index(archive.get(), static_cast<zip_uint64_t>(i), 0, &stat), 0);
    const std::unique_ptr<zip_file_t, decltype(&zip_fclose)> file(
        zip_fopen_index(archive.get(), static_cast<zip_uint64_t>(i), 0), &zip_fclose);
    std::string text(stat.size, ' ');
    EXPECT_EQ(zip_fread(file.get(), text.data(), text.size()),
              static_cast<zip_int64_t>(text.size()));
    files[stat.name] = text;
  }
  return files;
}

TEST(ZipArchiveTest, HoldsWhatWasPutIn) {
  const std::string picture = "PNG " + std::string(5000, 'x');
  const std::string bytes =
      web::ZipOf({{.name = "a.csv", .bytes = std::string(5000, 'y')},
                  {.name = "scans/1/b.png", .bytes = picture, .is_compressed = true},
                  {.name = "empty.txt", .bytes = ""}});
  const auto files = Unzipped(bytes);
  EXPECT_THAT(files, ElementsAre(Key("a.csv"), Key("empty.txt"), Key("scans/1/b.png")));
  EXPECT_EQ(files.at("scans/1/b.png"), picture);
  EXPECT_EQ(files.at("a.csv"), std::string(5000, 'y'));
  EXPECT_GT(bytes.size(), picture.size()) << "a picture is stored as it is";
  EXPECT_LT(bytes.size(), 2 * picture.size()) << "text is packed";
  EXPECT_TRUE(Unzipped(web::ZipOf({{.name = "one", .bytes = "1"}})).contains("one"));
}

TEST(ZipArchiveTest, RefusesANameThatIsThereTwice) {
  EXPECT_THROW((void)web::ZipOf({{.name = "a", .bytes = "1"}, {.name = "a", .bytes = "2"}}),
               IoError);
}

class CourseArchiveTest : public WebTest {};

TEST_F(CourseArchiveTest, HoldsSummaryNumbersAndTheResultsOfComparedScans) {
  const testing::TempFolder folder;
  std::filesystem::create_directories(folder.path() / "result");
  std::ofstream(folder.path() / "result/result.json") << "{\"verdict\": \"move\"}";
  std::ofstream(folder.path() / "result/error_map.png") << "PNG";  // no overlay: it was removed
  Patient patient;
  patient.id = "p1";
  patient.code = "P-0042";
  service_.patients.push_back(patient);
  Scan scan;
  scan.id = "s7";
  scan.patient_id = "p1";
  scan.outcome = ScanOutcome::kDone;
  scan.folder = folder.path();
  scan.result = ResultSummary{};
  scan.result->verdict = Verdict::kMove;
  scan.result->correction.emplace().vertical_mm = -8.25;
  scan.daily_check = DailyCheck::kFailed;
  scan.accepted_by = "anna";
  scan.accepted_reason = "=cmd|'/C calc'!A0, \"really\"";
  service_.scans.push_back(scan);
  scan.id = "s6";  // compared, but its files are out of sight
  scan.folder.clear();
  scan.failure = Message::Verbatim("its files cannot be used now: its folder is missing");
  service_.scans.push_back(scan);
  scan.folder = folder.path();
  scan.failure = {};
  scan.id = "s8";  // a reference has no result
  scan.result.reset();
  service_.scans.push_back(scan);
  Start();
  SetUpAccounts();
  HttpClient client = LoggedIn("technician");
  const auto answer = client.Get("/api/v1/patients/p1/course.zip?language=" +
                                 std::string(Catalogues().back()->code));
  ASSERT_EQ(answer.status, 200);
  const auto files = Unzipped(answer.body);
  EXPECT_THAT(files, ElementsAre(Key("course.pdf"), Key("left_out.txt"), Key("numbers.csv"),
                                 Key("numbers.json"), Key("scans/s7/error_map.png"),
                                 Key("scans/s7/result.json")));
  EXPECT_THAT(files.at("left_out.txt"), HasSubstr("s7/overlay.png\r\n"));
  EXPECT_THAT(files.at("left_out.txt"),
              HasSubstr("s6: its files cannot be used now: its folder is missing\r\n"));
  EXPECT_THAT(files.at("numbers.csv"), HasSubstr("P-0042;s7"));
  EXPECT_THAT(files.at("numbers.csv"), HasSubstr(";-8,2500;")) << "a number stays one";
  EXPECT_THAT(files.at("numbers.csv"), HasSubstr(R"("'=cmd|'/C calc'!A0, ""really""")"))
      << "what a person typed is no formula";
  EXPECT_THAT(files.at("numbers.csv"),
              HasSubstr(";check_overdue;check_failed;judgement_vertical;"));
  EXPECT_THAT(files.at("numbers.csv"), HasSubstr(";yes;yes;"));
  EXPECT_EQ(service_.report_language, Catalogues().back()->code);
  EXPECT_EQ(client.Get("/api/v1/patients/p1/course.zip?language=xx").status, 400);
  EXPECT_EQ(client.Get("/api/v1/patients/p2/course.zip").status, 404);
}

}  // namespace
}  // namespace plumb::test

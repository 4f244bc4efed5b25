// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/unit/doctor_report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace plumb {
namespace {

using ::testing::HasSubstr;

DoctorReport SomeReport() {
  DoctorReport report;
  report.Good(say::doctor::Sensor(), say::doctor::Attached("PS1080", "0001"));
  report.Note(say::doctor::Gpio(), say::doctor::NoChip(), say::doctor::UsePageOrBoard());
  report.Bad(say::doctor::State(), say::doctor::LittleSpace("/var/lib/plumb", 1.26),
             say::doctor::FreeSpace(), kInternalError);
  return report;
}

TEST(DoctorReportTest, IsReadInEveryLanguage) {
  for (const Catalogue* language : Catalogues()) {
    const std::string text = SomeReport().Text(*language);
    for (const Message& said :
         {say::doctor::Good(), say::doctor::Sensor(), say::doctor::NoChip(),
          say::doctor::UsePageOrBoard(), say::doctor::Bad(),
          say::doctor::LittleSpace("/var/lib/plumb", 1.26), say::doctor::NotReady()})
      EXPECT_THAT(text, HasSubstr(Text(said, *language))) << language->code;
  }
  EXPECT_EQ(SomeReport().Text(EnglishCatalogue()),
            "ok    sensor         PS1080, serial 0001\n"
            "note  GPIO           no chip: no hardware button and light\n"
            "                     -> use the page's button, `plumb press` or a board with GPIO\n"
            "BAD   state          /var/lib/plumb: 1.3 GB free\n"
            "                     -> free space: a scan needs up to 1 GB while it runs\n"
            "Not ready to scan: see BAD above.\n");
}

TEST(DoctorReportTest, JsonHasEnglishAndTheMessages) {
  const nlohmann::ordered_json json = SomeReport().Json();
  EXPECT_EQ(json["ready"], false);
  const nlohmann::ordered_json& bad = json["findings"][2];
  EXPECT_EQ(bad["state"], "bad");
  EXPECT_EQ(bad["what"], "state");
  EXPECT_EQ(bad["found"], "/var/lib/plumb: 1.3 GB free");
  EXPECT_EQ(bad["found_message"]["id"], "doctor.little_space");
  EXPECT_EQ(bad["found_message"]["arguments"]["room"]["unit"], "GB");
  EXPECT_EQ(json["findings"][0]["remedy"], "");
  EXPECT_EQ(json["findings"][0]["remedy_message"], nullptr);
}

}  // namespace
}  // namespace plumb

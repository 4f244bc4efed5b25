// SPDX-License-Identifier: Apache-2.0
// The diagnostics hold nothing of a patient and no account.
#include "daemon/unit/diagnostics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace plumb {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(DiagnosticsTest, HoldHowTheApplianceDoesAndNothingOfPatientsOrAccounts) {
  const nlohmann::json status = {{"state", "result"},
                                 {"sensor", {{"serial", "ABC123"}}},
                                 {"scan", {{"id", "000777"}}},
                                 {"later", "a field that nobody thought of"},
                                 {"last_result",
                                  {{"scan", "000777"},
                                   {"verdict", "move"},
                                   {"vertical_mm", 8.57},
                                   {"reasons", {"the left arm moved"}},
                                   {"frames", 301}}}};
  AuditEntry entry;
  entry.number = 12;
  entry.user = "anna";
  entry.action = "patient.add";
  entry.subject = "PAT-0042";
  entry.detail = Message::Verbatim("left breast");
  Health health;
  health.ok = false;
  health.reason = Message::Verbatim("the disk is full");
  const std::string text = DiagnosticsText(status, health, "turns 5", {entry});
  for (const char* held : {"the disk is full", "ABC123", "\"frames\":301", "turns 5",
                           "12 patient.add", "\"state\":\"result\""})
    EXPECT_THAT(text, HasSubstr(held));
  for (const char* not_held : {"000777", "\"move\"", "8.57", "left arm", "anna", "PAT-0042",
                               "left breast", "nobody thought of"})
    EXPECT_THAT(text, Not(HasSubstr(not_held)));
  EXPECT_THAT(DiagnosticsText({{"last_result", nullptr}}, health, "", {}),
              HasSubstr("\"last_result\":{}"));
}

TEST(DiagnosticsTest, FreeTextsSayWhatIsWrongWithoutNumbersAndPaths) {
  const std::string missing =
      "3 of 5 stored scans cannot be seen (of scan 000777, its folder is missing): is the disk "
      "mounted at /srv/anna-miller/scans? Nothing was changed.";
  const std::string reference =
      "the scan failed: the patient's reference cannot be used: scene/cloud.ply is missing in "
      "/srv/anna-miller/scans/000778; put a backup of the scan's files in their place";
  const std::string backup = "The last backup failed: cannot write /mnt/p4711/plumb-5/plumb.db";
  Health health;
  health.ok = false;
  health.reason = Message::Verbatim("storage: " + missing);
  const std::string text = DiagnosticsText({{"state", "fault"},
                                            {"reason", reference},
                                            {"rolled_back", "from scan 000779"},
                                            {"warnings", {backup, missing}}},
                                           health, "", {});
  for (const char* held :
       {"stored scans cannot be seen", "its folder is missing", "the patient's reference cannot",
        "is missing in <path>; put a backup", "The last backup failed", "health: storage: # of #"})
    EXPECT_THAT(text, HasSubstr(held));
  for (const char* not_held : {"777", "778", "779", "4711", "anna", "/srv", "/mnt", "000"})
    EXPECT_THAT(text, Not(HasSubstr(not_held)));
}

}  // namespace
}  // namespace plumb

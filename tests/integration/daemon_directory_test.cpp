// SPDX-License-Identifier: Apache-2.0
// From [directory] of plumb.toml to the log-in of the page: a real plumbd and a real slapd.
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"
#include "tests/support/skip.hpp"
#include "tests/support/slapd.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using test::HttpAnswer;
using test::HttpClient;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Plumbd;
using testing::Slapd;

class DaemonDirectoryTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }

  static HttpAnswer LogIn(const Plumbd& plumbd, const std::string& name,
                          const std::string& password = Slapd::kPassword) {
    return HttpClient(plumbd.port())
        .Post("/api/v1/login", {{"name", name}, {"password", password}});
  }

  testing::TempFolder folder_;
};

TEST_F(DaemonDirectoryTest, PeopleComeInByTheirGroupsAndTheUnitsOwnGoOnWhileItIsAway) {
  if (!Slapd::IsInstalled()) PLUMB_SKIP("there is no slapd");
  Slapd slapd(folder_ / "directory");
  std::ofstream(folder_ / "plumb.toml") << fmt::format(
      "[directory]\nurl = \"{}\"\ntrusted = \"{}\"\nperson = \"{}\"\ngroups_base = \"{}\"\n"
      "physicists = [\"cn=physicists,{}\"]\ntechnicians = [\"cn=therapists,{}\"]\n",
      slapd.tls_url(), slapd.certificate().string(), Slapd::kPerson, Slapd::kGroups, Slapd::kGroups,
      Slapd::kGroups);
  Plumbd plumbd(folder_.path(), {.arguments = {"--config", (folder_ / "plumb.toml").string()}});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  HttpClient engineer = plumbd.MakeFirstAccount();

  EXPECT_EQ(LogIn(plumbd, "anna").json()["role"], "technician");
  EXPECT_EQ(LogIn(plumbd, "marie").json()["role"], "physicist");
  const HttpAnswer visitor = LogIn(plumbd, "visitor");
  EXPECT_EQ(visitor.status, 403);
  EXPECT_THAT(visitor.body, HasSubstr("none of your groups"));
  EXPECT_EQ(LogIn(plumbd, "anna", "another password").status, 403);

  HttpClient marie(plumbd.port());
  ASSERT_EQ(marie.LogIn("marie", Slapd::kPassword), 200);
  const auto sign = [&](const char* password) {
    return marie.Put("/api/v1/session/pin", {{"pin", "4711"}, {"password", password}}).status;
  };
  EXPECT_EQ(sign("another password"), 403) << "a signature asks the directory, too";
  EXPECT_EQ(sign(Slapd::kPassword), 200);
  EXPECT_EQ(marie.Get("/api/v1/users").status, 403) << "what her role may not";

  slapd.Stop();
  const HttpAnswer away = LogIn(plumbd, "anna");
  EXPECT_EQ(away.status, 503);
  EXPECT_THAT(away.body, HasSubstr("directory does not answer"));
  EXPECT_EQ(LogIn(plumbd, "engineer", test::kPassword).status, 200);
  EXPECT_EQ(marie.Get("/api/v1/session").status, 200) << "what is open goes on";
  slapd.Start();
  EXPECT_EQ(LogIn(plumbd, "anna").status, 200);

  std::map<std::string, bool> in_directory;
  const json users = engineer.Get("/api/v1/users").json()["users"];
  for (const json& user : users) in_directory[user["name"]] = user["in_directory"];
  EXPECT_EQ(in_directory,
            (std::map<std::string, bool>{{"anna", true}, {"engineer", false}, {"marie", true}}));
  EXPECT_EQ(plumbd.Stop(), 0);
  EXPECT_THAT(plumbd.log(), Not(HasSubstr(Slapd::kPassword)));
}

}  // namespace
}  // namespace plumb

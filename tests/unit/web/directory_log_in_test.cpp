// SPDX-License-Identifier: Apache-2.0
// People of the clinic's directory on the page: accounts and roles follow from it, the unit's own
// accounts do without it.
#include <gmock/gmock.h>

#include <functional>
#include <map>
#include <mutex>
#include <semaphore>
#include <thread>

#include <fmt/format.h>

#include "tests/unit/web/web_fixture.hpp"
#include "words/directory.hpp"
#include "words/web.hpp"

namespace plumb::test {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class DirectoryTest : public WebTest {
 protected:
  void StartWithDirectory() {
    Start([this](web::HttpServerOptions& options) {
      options.ask_directory = std::bind_front(&DirectoryTest::Ask, this);
    });
  }
  bool Ask(const std::string& name, const std::string& password,
           std::function<void(const web::DirectoryAnswer&)> done) {
    const std::scoped_lock lock(mutex_);
    ++asked_[name];
    if (is_full_) return false;
    web::DirectoryAnswer answer;
    answer.failure = failure_;
    answer.refusal = refusal_;
    answer.matches =
        failure_.empty() && refusal_.empty() && roles_.contains(name) && password == kPassword;
    if (answer.matches) answer.role = roles_[name];
    if (is_slow_) {
      late_ = [answer, done = std::move(done)] { done(answer); };
      is_asked_.release();
    } else {
      done(answer);
    }
    return true;
  }
  /// From now on the directory answers when late_ is called; is_asked_ says that it is asked.
  void SetSlow() {
    const std::scoped_lock lock(mutex_);
    is_slow_ = true;
  }
  void SetRole(const std::string& name, std::optional<Role> role) {
    const std::scoped_lock lock(mutex_);
    roles_[name] = role;
  }
  void SetFailure(const Message& failure) {
    const std::scoped_lock lock(mutex_);
    failure_ = failure;
  }
  void SetRefusal(const Message& refusal) {
    const std::scoped_lock lock(mutex_);
    refusal_ = refusal;
  }
  void SetFull() {
    const std::scoped_lock lock(mutex_);
    is_full_ = true;
  }
  /// Of an act that needs the password.
  static int Sign(HttpClient& client, const std::string& password = kPassword,
                  std::string* words = nullptr) {
    const HttpAnswer answer =
        client.Put("/api/v1/session/pin", {{"pin", "4711"}, {"password", password}});
    if (words != nullptr) *words = answer.body;
    return answer.status;
  }
  int Asked(const std::string& name) {
    const std::scoped_lock lock(mutex_);
    return asked_[name];
  }
  HttpAnswer LogIn(HttpClient& client, const std::string& name,
                   const std::string& password = kPassword) {
    return client.Post("/api/v1/login", {{"name", name}, {"password", password}});
  }
  json Account(const std::string& name) {
    const json users = LoggedIn("engineer").Get("/api/v1/users").json()["users"];
    for (const json& user : users)
      if (user["name"] == name) return user;
    return nullptr;
  }
  static int ChangeAnna(HttpClient& engineer, json change) {
    change["own_password"] = kPassword;
    return engineer.Put("/api/v1/users/anna", change).status;
  }

  std::mutex mutex_;
  std::map<std::string, std::optional<Role>> roles_;
  std::map<std::string, int> asked_;
  Message failure_, refusal_;
  bool is_full_ = false, is_slow_ = false;
  std::function<void()> late_;
  std::binary_semaphore is_asked_{0};
};

class DirectoryLogInTest : public DirectoryTest {
 protected:
  void SetUp() override {
    StartWithDirectory();
    SetUpAccounts();
    SetRole("anna", Role::kTechnician);
    SetRole("marie", Role::kPhysicist);
    SetRole("visitor", std::nullopt);
  }
};

TEST_F(DirectoryTest, NobodyOfTheDirectoryComesInBeforeTheFirstEngineer) {
  StartWithDirectory();
  SetRole("anna", Role::kTechnician);
  HttpClient anna(port_);
  EXPECT_EQ(LogIn(anna, "anna").status, 403);
  EXPECT_EQ(Asked("anna"), 0);
  WebTest::TearDown();
  StartWithDirectory();
  EXPECT_NE(setup_code_, "") << "an account would have ended the set-up for good";
  SetUpAccounts();
  HttpClient again(port_);
  EXPECT_EQ(LogIn(again, "anna").status, 200);
}

TEST_F(DirectoryLogInTest, TheFirstLogInMakesTheAccountWithTheRoleOfTheGroups) {
  EXPECT_EQ(Account("anna"), nullptr);
  HttpClient anna(port_);
  const HttpAnswer answer = LogIn(anna, "Anna");
  ASSERT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(answer.json()["user"], "anna") << "capital letters make no other person";
  EXPECT_EQ(answer.json()["role"], "technician");
  EXPECT_EQ(Account("anna")["in_directory"], true);
  EXPECT_EQ(Account("technician")["in_directory"], false);
  anna.FetchToken();
  const json session = anna.Get("/api/v1/session").json();
  EXPECT_EQ(session["in_directory"], true);
  EXPECT_EQ(session["password_change_required"], false);
}

TEST_F(DirectoryLogInTest, AWrongPasswordIsAnsweredAsAnyOtherAndCounted) {
  HttpClient stranger(port_);
  const HttpAnswer wrong = LogIn(stranger, "anna", "not this one at all");
  EXPECT_EQ(wrong.status, 403);
  EXPECT_EQ(wrong.body, LogIn(stranger, "engineer", "not this one at all").body);
  EXPECT_EQ(Account("anna"), nullptr);
  int status = 403;
  for (int i = 0; i < 20 && status == 403; ++i)
    status = LogIn(stranger, "anna", "not this one at all").status;
  EXPECT_EQ(status, 429);
}

TEST_F(DirectoryLogInTest, APersonWithoutAGroupOfThisUnitIsRefusedAndNotSlowedDown) {
  HttpClient visitor(port_);
  for (int i = 0; i < 7; ++i) {
    const HttpAnswer answer = LogIn(visitor, "visitor");
    EXPECT_EQ(answer.status, 403) << "the password is right";
    EXPECT_THAT(answer.body, HasSubstr("none of your groups"));
  }
  EXPECT_EQ(Account("visitor"), nullptr);
}

TEST_F(DirectoryLogInTest, WhileTheDirectoryIsAwayTheUnitsOwnAccountsGoOn) {
  HttpClient before(port_);
  ASSERT_EQ(LogIn(before, "anna").status, 200);
  SetFailure(say::web::NothingHere());
  HttpClient anna(port_);
  const HttpAnswer answer = LogIn(anna, "anna");
  EXPECT_EQ(answer.status, 503);
  EXPECT_THAT(answer.body, HasSubstr("only people with an account of this unit"));
  HttpClient technician(port_);
  EXPECT_EQ(LogIn(technician, "technician").status, 200);
  EXPECT_EQ(Asked("technician"), 0) << "a password of this unit leaves it for no directory";
  SetFull();
  EXPECT_EQ(LogIn(anna, "anna").status, 503);
}

TEST_F(DirectoryLogInTest, AQuestionWithoutAnAnswerIsNoGuess) {
  HttpClient marie(port_);
  ASSERT_EQ(marie.LogIn("marie", kPassword), 200);
  SetFailure(say::web::NothingHere());
  HttpClient anna(port_);
  for (int i = 0; i < 7; ++i) {
    EXPECT_EQ(LogIn(anna, "anna").status, 503);
    EXPECT_EQ(Sign(marie), 503);
  }
  HttpClient engineer(port_);
  EXPECT_EQ(LogIn(engineer, "engineer").status, 200) << "from the same address";
  SetFailure({});
  SetFull();
  for (int i = 0; i < 7; ++i) EXPECT_EQ(LogIn(anna, "anna").status, 503);
}

TEST_F(DirectoryLogInTest, AnAccountThatTheDirectoryLocksIsNamedAndEachAttemptCounts) {
  HttpClient marie(port_);
  ASSERT_EQ(marie.LogIn("marie", kPassword), 200);
  SetRefusal(say::directory::RefusesPerson("locked"));
  HttpClient anna(port_);
  const HttpAnswer answer = LogIn(anna, "anna");
  EXPECT_EQ(answer.status, 403);
  EXPECT_THAT(answer.body, HasSubstr("refuses this log-in: locked"));
  std::string words;
  EXPECT_EQ(Sign(marie, kPassword, &words), 403);
  EXPECT_THAT(words, HasSubstr("refuses this log-in: locked"));
  int status = 403;
  for (int i = 0; i < 20 && status == 403; ++i) status = LogIn(anna, "anna").status;
  EXPECT_EQ(status, 429) << "or guesses here would keep the account locked";
}

TEST_F(DirectoryLogInTest, ThePageWithoutScriptsSaysThatTheDirectoryRefuses) {
  const auto where = [&](const std::string& name, const std::string& password) {
    HttpClient client(port_);
    client.extra_headers["Content-Type"] = "application/x-www-form-urlencoded";
    const HttpAnswer answer =
        client.Ask("POST", "/login", "name=" + name + "&password=" + password);
    EXPECT_EQ(answer.status, 303) << answer.body;
    return answer.Header("location");
  };
  const std::string password = "correct+horse%20battery";
  EXPECT_EQ(where("visitor", password), "/result?failed=directory") << "none of the groups";
  EXPECT_EQ(where("anna", "wrong"), "/result?failed=1");
  SetRefusal(say::directory::RefusesPerson("locked"));
  EXPECT_EQ(where("anna", password), "/result?failed=directory");
  HttpClient anna(port_);
  EXPECT_THAT(anna.Get("/result?failed=directory").body,
              AllOf(HasSubstr("directory does not let you in"), Not(HasSubstr("or password"))));
}

TEST_F(DirectoryLogInTest, WhileTheDirectoryThinksOthersGoOn) {
  SetSlow();
  HttpAnswer answer;
  std::jthread asking([&] {
    HttpClient anna(port_);
    answer = LogIn(anna, "anna");
  });
  is_asked_.acquire();
  EXPECT_EQ(LoggedIn("engineer").Get("/api/v1/users").status, 200);
  loop_->Do([&] { late_(); });
  asking.join();
  EXPECT_EQ(answer.json()["role"], "technician");
}

TEST_F(DirectoryLogInTest, AnAnswerAfterTheEndOfTheServerIsForNobody) {
  SetSlow();
  const std::string body = json{{"name", "anna"}, {"password", kPassword}}.dump();
  HttpConnection anna(port_);
  anna.Send(
      fmt::format("POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nContent-Type: "
                  "application/json\r\nContent-Length: {}\r\n\r\n{}",
                  body.size(), body));
  is_asked_.acquire();
  WebTest::TearDown();
  late_();
  EXPECT_FALSE(service_.FindUser("anna"));
}

TEST_F(DirectoryLogInTest, AnotherGroupIsAnotherRoleAndEndsWhatWasOpen) {
  HttpClient anna(port_);
  ASSERT_EQ(anna.LogIn("anna", kPassword), 200);
  SetRole("anna", Role::kPhysicist);
  HttpClient again(port_);
  EXPECT_EQ(LogIn(again, "anna").json()["role"], "physicist");
  EXPECT_EQ(Account("anna")["role"], "physicist");
  EXPECT_EQ(anna.Get("/api/v1/session").status, 401);
  SetRole("anna", std::nullopt);
  HttpClient third(port_);
  EXPECT_EQ(LogIn(third, "anna").status, 403);
  EXPECT_EQ(again.Get("/api/v1/session").status, 401) << "nothing stays open";
}

TEST_F(DirectoryLogInTest, ASignatureAsksAgain) {
  HttpClient marie(port_);
  ASSERT_EQ(marie.LogIn("marie", kPassword), 200);
  EXPECT_EQ(Sign(marie, "not this one at all"), 403);
  const int asked = Asked("marie");
  EXPECT_EQ(Sign(marie), 200);
  EXPECT_EQ(Asked("marie"), asked + 1);
  SetRole("marie", Role::kTechnician);
  std::string words;
  EXPECT_EQ(Sign(marie, kPassword, &words), 403);
  EXPECT_THAT(words, HasSubstr("have changed"));
  EXPECT_EQ(marie.Get("/api/v1/session").status, 401) << "the rights of before are gone";
}

TEST_F(DirectoryLogInTest, PasswordAndRoleAreChangedThereAndTheAccountCanBeDisabledHere) {
  HttpClient anna(port_);
  ASSERT_EQ(anna.LogIn("anna", kPassword), 200);
  EXPECT_EQ(anna.Post("/api/v1/session/password",
                      {{"old_password", kPassword}, {"password", "another long one"}})
                .status,
            400);
  HttpClient engineer = LoggedIn("engineer");
  EXPECT_EQ(ChangeAnna(engineer, {{"role", "engineer"}}), 400);
  EXPECT_EQ(ChangeAnna(engineer, {{"password", "another long one"}}), 400);
  EXPECT_EQ(ChangeAnna(engineer, {{"disabled", true}}), 200);
  EXPECT_EQ(anna.Get("/api/v1/session").status, 401);
  const int asked = Asked("anna");
  HttpClient again(port_);
  EXPECT_EQ(LogIn(again, "anna").status, 403);
  EXPECT_EQ(Asked("anna"), asked);
}

TEST_F(DirectoryLogInTest, WithoutTheDirectoryItsAccountsGetAPasswordOfThisUnit) {
  {
    HttpClient anna(port_);
    ASSERT_EQ(LogIn(anna, "anna").status, 200);
    EXPECT_EQ(LoggedIn("engineer").Get("/api/v1/users").json()["directory"], true);
  }
  WebTest::TearDown();
  Start();  // [directory] was taken out
  HttpClient engineer = LoggedIn("engineer");
  EXPECT_EQ(engineer.Get("/api/v1/users").json()["directory"], false);
  EXPECT_EQ(ChangeAnna(engineer, {{"role", "physicist"}}), 200);
  EXPECT_EQ(ChangeAnna(engineer, {{"password", kFirstPassword}}), 200);
  EXPECT_EQ(Account("anna")["in_directory"], false);
  HttpClient anna(port_);
  EXPECT_EQ(LogIn(anna, "anna", kFirstPassword).json()["role"], "physicist");
}

}  // namespace
}  // namespace plumb::test

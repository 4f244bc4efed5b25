// SPDX-License-Identifier: Apache-2.0
// Logging in and out: guesses, presence in the room, password, second factor.
#include <algorithm>
#include <cctype>
#include <utility>

#include "algo/base/ascii_lower.hpp"
#include "web/api/accounts.hpp"
#include "web/exchange/json.hpp"
#include "web/http/checks.hpp"
#include "web/http/connection_table.hpp"
#include "web/model/account.hpp"
#include "web/model/wall_clock.hpp"
#include "web/security/second_factor.hpp"
#include "web/security/secrets.hpp"
#include "web/security/stored_password.hpp"
#include "words/audit.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr std::chrono::minutes kPresenceValid{10};

/// As it is compared: people leave out the dash, or type small letters.
std::string Characters(const std::string& code) {
  std::string text;
  for (const unsigned char c : code)
    if (std::isalnum(c) != 0) text += static_cast<char>(std::toupper(c));
  return text;
}

Response SecondFactorNeeded(const Message& why) {
  Json json = {{"second_factor_required", true}};
  PutMessage(json, "error", why);
  return JsonResponse(json, /*status=*/403);
}

Response Redirect(const std::string& where) {
  Response response = BodyResponse("text/plain; charset=utf-8", "");
  response.status = 303;
  response.headers.emplace_back("Location", where);
  return response;
}

/// Leads the page without scripts to where it says that the log-in was refused.
/// @param by  "1", or "directory": by that of the clinic, not for a wrong password.
Respond Refusing(const LogInForm& form, const Respond& respond, const std::string& by = "1") {
  return [respond, by, is_form = form.is_form](Response response) {
    respond(is_form && response.status == 403 ? Redirect("/result?failed=" + by)
                                              : std::move(response));
  };
}

}  // namespace

Response BusyWithPasswords() {
  return RetryLater(503, say::web::TooManyLogIns(), std::chrono::seconds(5));
}

Response Accounts::Welcome(const User& user, const std::string& address, bool form) {
  if (form && IsFirst(user.password_hash)) return Redirect("/result?first=1");
  const Sessions::Opened opened = sessions_.Open(user, address, options_.now());
  opened.session->must_change_password = IsFirst(user.password_hash);
  Response response =
      form ? Redirect("/result") : JsonResponse({{"user", user.name}, {"role", Name(user.role)}});
  SetDeviceCookie(response, user.name, user.password_hash);
  SetCookie(response, cookie_name(), opened.token, certificate_.has_value());
  return response;
}

void Accounts::SetDeviceCookie(Response& response, const std::string& user,
                               const std::string& stored) {
  constexpr std::chrono::hours kYear{365 * 24};
  const std::string made = devices_.Make(user, stored);
  SetCookie(response, devices_.NameFor(user), made, certificate_.has_value(), kYear);
  if (const auto device = devices_.Identify(made, user, stored))
    quick_.Open(*device, user, options_.now());
}

std::string Accounts::presence_code() {
  const auto now = options_.now();
  if (presence_.empty() || now - presence_made_ >= kPresenceValid) {
    const bool is_recent = !presence_.empty() && now - presence_made_ < 2 * kPresenceValid;
    presence_before_ = is_recent ? presence_ : std::string();
    presence_ = RandomCode(8);  // 40 bits
    presence_made_ = now;
  }
  return presence_;
}

bool Accounts::IsInTheRoom(const Request& request, const std::string& presence) {
  if (displays_.SessionOf(request)) return true;
  if (presence.empty()) return false;
  const std::string given = Characters(presence), now = Characters(presence_code());
  return IsSameSecret(given, now) ||
         (!presence_before_.empty() && IsSameSecret(given, Characters(presence_before_)));
}

Response Accounts::DescribePresence(const Request& request) {
  if (request.session->role != Role::kDisplay) return ErrorResponse(404, say::web::NothingHere());
  return JsonResponse({{"code", guessed_ ? Json(presence_code()) : Json(nullptr)}});
}

void Accounts::NoteGuesses(bool are_running) {
  const bool were_running = guessed_.has_value();
  guessed_ = are_running ? std::optional(options_.now()) : std::nullopt;
  if (options_.on_guesses && were_running != are_running) options_.on_guesses(are_running);
}

Accounts::Counters Accounts::CountersOf(const Request& request, const LogInForm& form,
                                        const std::string& stored) {
  const std::string network = NetworkOf(request.address);
  const auto cookie = CookieValue(request.Header("cookie"), devices_.NameFor(form.name));
  if (const auto device = cookie ? devices_.Identify(*cookie, form.name, stored) : std::nullopt)
    return {{"device " + *device}, /*is_known=*/true};
  if (IsInTheRoom(request, form.presence)) return {{"room " + network}, /*is_known=*/true};
  const auto now = options_.now();
  if (places_.Knows(form.name, network, now))
    return {{"place " + network + " " + form.name}, /*is_known=*/true};
  // An address counts once a minute for the name, so that one alone locks nobody out. (Not longer:
  // each address could go on guessing for good once it had begun.)
  const std::string begun = "begun " + network + " " + form.name;
  if (limiter_.Wait(begun, now, /*most=*/1).count() > 0) return {{"address " + network}};
  return {{"address " + network, "name " + form.name, begun}};
}

std::optional<Response> Accounts::CountGuess(const std::vector<std::string>& counters) {
  const auto now = options_.now();
  std::chrono::seconds wait{0};
  for (const std::string& counter : counters) wait = std::max(wait, limiter_.Wait(counter, now));
  if (wait.count() > 0) return RetryLater(429, say::web::WaitAfterPasswords(wait.count()), wait);
  // Counted before hashing, so that many guesses sent at once are as slow as one after the other.
  for (const std::string& counter : counters) limiter_.Failed(counter, now);
  return std::nullopt;
}

void Accounts::TakeGuessBack(const std::vector<std::string>& counters) {
  for (const std::string& counter : counters) limiter_.TakeBack(counter);
}

void Accounts::EndAllOf(const std::string& name) {
  sessions_.EndAllOf(name, nullptr);
  quick_.EndAllOf(name);
}

void Accounts::AskDirectoryOf(const std::string& name, std::string password,
                              const std::vector<std::string>& counters, const Respond& respond,
                              std::function<void(const DirectoryAnswer&)> done) {
  const bool asked =
      options_.ask_directory(name, std::move(password),
                             [this, alive = std::weak_ptr(alive_), counters, respond,
                              done = std::move(done)](const DirectoryAnswer& answer) {
                               if (alive.expired()) return;
                               if (answer.failure.empty())
                                 return RespondGuarded(
                                     "directory", [&] { done(answer); }, respond);
                               // No guess: it must not delay people who have an account of the
                               // unit's own.
                               TakeGuessBack(counters);
                               respond(ErrorResponse(503, say::web::DirectoryAway(answer.failure)));
                             });
  if (asked) return;
  TakeGuessBack(counters);
  respond(BusyWithPasswords());
}

void Accounts::LogIn(const Request& request, LogInForm form, const Respond& respond) {
  // Whoever checks it wipes it; what waits here for the answer has no copy.
  std::string password = std::exchange(form.password, {});
  // A directory knows no difference between capital and small letters; accounts have small ones.
  if (options_.ask_directory) form.name = AsciiLower(form.name);
  const auto user = users_.FindUser(form.name);
  const std::string stored = user && !user->disabled ? user->password_hash : std::string();
  const auto [counters, is_known] = CountersOf(request, form, stored);
  if (auto refusal = CountGuess(counters)) {
    if (!is_known) NoteGuesses(true);
    return respond(std::move(*refusal));
  }
  if (!user) {
    if (const Message why = users_.WhyUnreadable(); !why.empty())
      return respond(ErrorResponse(503, say::web::NobodyCanLogIn(why)));
  }
  const Actor actor{form.name, request.address};
  // Not before the set-up: with an account of the directory there would be no code for it any more,
  // and the unit could never get an engineer.
  if (options_.ask_directory && !needs_setup() && IsName(form.name) &&
      (!user || IsInDirectory(stored)))
    return AskDirectoryOf(form.name, std::move(password), counters, respond,
                          [=, this, counters = counters](const DirectoryAnswer& answer) {
                            FinishDirectoryLogIn(actor, answer, form, counters, respond);
                          });
  CheckPassword(
      std::move(password), HashIn(stored), is_known, respond,
      [this, counters = counters] { TakeGuessBack(counters); },
      [this, actor, stored, form, counters = counters, respond](bool matches) {
        FinishLogIn(actor, matches ? stored : std::string(), form, counters, respond);
      });
}

void Accounts::FinishDirectoryLogIn(const Actor& actor, const DirectoryAnswer& answer,
                                    const LogInForm& form, const std::vector<std::string>& counters,
                                    const Respond& respond) {
  if (!answer.refusal.empty()) {
    LogFailedLogIn(actor, answer.refusal);
    return Refusing(form, respond, "directory")(ErrorResponse(403, answer.refusal));
  }
  if (!answer.matches) return FinishLogIn(actor, {}, form, counters, respond);
  if (!answer.role) {
    TakeGuessBack(counters);
    EndAllOf(actor.user);
    audit_.Log(actor, "login.failed", "", say::audit::NoRoleInDirectory());
    return Refusing(form, respond, "directory")(ErrorResponse(403, say::web::NoRoleInDirectory()));
  }
  const std::optional<User> known = users_.FindUser(actor.user);
  if (known && known->role == *answer.role)
    return FinishLogIn(actor, kInDirectory, form, counters, respond);
  const Done done = WhileAlive([=, this](const Change& change) {
    if (change.result != ChangeResult::kDone) return respond(ChangeResponse(change));
    // The permissions of sessions are those of their log-in.
    EndAllOf(actor.user);
    FinishLogIn(actor, kInDirectory, form, counters, respond);
  });
  if (known) {
    UserChange change;
    change.name = actor.user;
    change.role = answer.role;
    change.expected_hash = kInDirectory;
    return users_.ChangeUser(actor, change, done);
  }
  User user;
  user.name = actor.user;
  user.role = *answer.role;
  user.password_hash = kInDirectory;
  user.created_at = WallClock::now();
  users_.AddUser(actor, user, done);
}

void Accounts::LogFailedLogIn(const Actor& actor, const Message& why) {
  // The name as typed is not logged, because people type passwords there.
  const bool is_known = users_.FindUser(actor.user).has_value();
  audit_.Log({is_known ? actor.user : std::string(), actor.address}, "login.failed", "", why);
}

void Accounts::FinishLogIn(const Actor& actor, const std::string& stored, const LogInForm& form,
                           const std::vector<std::string>& counters, const Respond& respond) {
  const auto still = users_.FindUser(actor.user);
  const Respond fail = Refusing(form, respond);
  if (stored.empty() || !still || still->disabled || still->password_hash != stored) {
    LogFailedLogIn(actor, {});
    return fail(ErrorResponse(403, say::web::WrongLogIn()));
  }
  PassSecondFactor(actor, *still, form.second_factor, fail,
                   [this, actor, user = *still, counters, is_form = form.is_form, respond] {
                     for (const std::string& counter : counters) limiter_.Succeeded(counter);
                     places_.Remember(user.name, NetworkOf(actor.address), options_.now());
                     audit_.Log(actor, "login", "", {});
                     respond(Welcome(user, actor.address, is_form));
                   });
}

void Accounts::PassSecondFactor(const Actor& actor, const User& user, const std::string& given,
                                const Respond& fail, const std::function<void()>& then) {
  if (!user.has_second_factor) return then();
  if (given.empty()) return fail(SecondFactorNeeded(say::web::SecondFactorMissing()));
  const std::optional<SecondFactor> factor = users_.FindSecondFactor(user.name);
  const auto left = factor ? UsedSecondFactor(*factor, given, WallClock::now()) : std::nullopt;
  if (!left) {
    audit_.Log(actor, "login.failed", "", say::audit::WrongSecondFactor());
    return fail(SecondFactorNeeded(say::web::SecondFactorWrong()));
  }
  const bool is_recovery = left->recovery_hashes != factor->recovery_hashes;
  users_.SetSecondFactor(actor, user.name, factor, left, is_recovery ? "user.recovery_code" : "",
                         WhileAlive([fail, then](const Change& change) {
                           // The same code twice at once: one of them was too late.
                           if (change.result != ChangeResult::kDone)
                             return fail(ChangeResponse(change));
                           RespondGuarded("second factor", then, fail);
                         }));
}

void Accounts::LogOut(const Request& request, const Respond& respond) {
  sessions_.End(request.session);
  audit_.Log(request.actor(), "logout", "", {});
  Response response = JsonResponse(Json::object());
  SetCookie(response, cookie_name(), "", certificate_.has_value(), std::chrono::seconds(0));
  respond(std::move(response));
}

}  // namespace plumb::web

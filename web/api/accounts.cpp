#include "web/api/accounts.hpp"

#include <fmt/format.h>
#include <sodium.h>

#include <algorithm>
#include <functional>

#include "algo/base/errors.hpp"
#include "algo/base/names.hpp"
#include "web/api/json.hpp"
#include "web/api/look_back.hpp"
#include "web/http/checks.hpp"
#include "web/http/connection_table.hpp"
#include "web/model/account.hpp"
#include "web/model/limits.hpp"
#include "web/model/wall_clock.hpp"
#include "web/security/password_rules.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxSetupGuesses = 1000;  // a minute, from all addresses
/// Prefix of the hash of a password chosen by somebody else: the person has to change it at the
/// next login.
constexpr std::string_view kFirst = "first ";

bool IsFirst(const std::string& stored) { return stored.starts_with(kFirst); }
/// In the form that libsodium takes.
std::string HashIn(const std::string& stored) {
  return IsFirst(stored) ? stored.substr(kFirst.size()) : stored;
}

std::string ReadNewPassword(Fields& fields, const std::string& user) {
  std::string password = fields.Text("password", kMinPassword, kMaxPassword);
  if (const std::string why = WhyNotPassword(password, user); !why.empty()) throw DataError(why);
  return password;
}

bool SameText(const std::string& a, const std::string& b) {
  return a.size() == b.size() && sodium_memcmp(a.data(), b.data(), a.size()) == 0;
}

std::string ReadName(Fields& fields) {
  std::string name = fields.Text("name", 1, kMaxName);
  const bool valid = IsName(name) && std::none_of(name.begin(), name.end(),
                                                  [](char c) { return c >= 'A' && c <= 'Z'; });
  if (!valid)
    throw DataError(
        "name must be small letters, digits, '.', '-' or '_', and not begin with a dot");
  return name;
}

Role ReadRole(Fields& fields) {
  const auto role = Named<Role>(fields.Text("role", 1, kMaxName));
  if (!role || role == Role::kDisplay)  // which is paired and has no account
    throw DataError("role must be technician, physicist or engineer");
  return *role;
}

Response Busy() {
  return RetryLater(503, "too many people are logging in; try again in a few seconds",
                    std::chrono::seconds(5));
}

Response Redirect(const std::string& where) {
  Response response = BodyResponse("text/plain; charset=utf-8", "");
  response.status = 303;
  response.headers.emplace_back("Location", where);
  return response;
}

}  // namespace

Accounts::Accounts(const Services& services, const HttpServerOptions& options,
                   std::function<void(const TlsIdentity&)> replace_certificate)
    : users_(services.accounts),
      audit_(services.audit),
      settings_(services.settings),
      patients_(services.patients),
      references_(services.references),
      scans_(services.scans),
      room_(services.room),
      profiles_(services.profiles),
      updates_(services.updates),
      background_(services.background),
      options_(options),
      replace_certificate_(std::move(replace_certificate)),
      certificate_(options.tls),
      displays_(services.displays, options.tls.has_value(), options.now),
      devices_(options.device_key, options.tls.has_value()),
      worker_(options.password_operations, options.password_memory_bytes) {
  LookForAccounts();
  Expire();
}

/// While accounts cannot be read, some may exist, so no setup code for a first account is issued.
void Accounts::LookForAccounts() {
  accounts_fault_ = users_.WhyUnreadable();
  if (!accounts_fault_.empty()) return;
  try {
    if (users_.Users().empty()) setup_code_ = RandomCode(8);  // 40 bits
  } catch (const std::exception& error) {
    accounts_fault_ = error.what();
  }
}

std::optional<std::string> Accounts::setup_code() const {
  return setup_code_.empty() ? std::nullopt : std::optional(setup_code_);
}

std::optional<int> Accounts::IdleLogout_min() const {
  try {
    return settings_.GetSettings().idle_logout_min;
  } catch (const IoError&) {
    return std::nullopt;
  }
}

void Accounts::Expire() {
  if (!accounts_fault_.empty()) LookForAccounts();
  idle_logout_min_ = IdleLogout_min().value_or(idle_logout_min_);
  sessions_.SetLimits(std::chrono::minutes(idle_logout_min_), options_.session_limit);
  sessions_.Expire(options_.now());
}

std::shared_ptr<Session> Accounts::SessionOf(const Request& request, bool touch) {
  const auto token = CookieValue(request.Header("cookie"), cookie_name());
  auto session = token ? sessions_.Find(*token, options_.now(), touch) : nullptr;
  return session ? session : displays_.SessionOf(request);
}

Done Accounts::WhileAlive(Done done) const {
  return [alive = std::weak_ptr(alive_), done = std::move(done)](const Change& change) {
    if (!alive.expired()) done(change);
  };
}

void Accounts::AddRoutes(Routes& routes) {
  displays_.AddRoutes(routes);
  AddSignedActs(routes);
  const auto add = [&](const char* method, const char* pattern, Permission permission,
                       BodyKind body, auto handler) {
    routes.Add(method, pattern, permission, body, std::bind_front(handler, this));
  };
  add("POST", "/api/v1/setup", Permission::kNone, BodyKind::kJson, &Accounts::SetUp);
  routes.Add("POST", "/api/v1/login", Permission::kNone, BodyKind::kJson,
             [this](const Request& request, const Respond& respond) {
               Fields fields(request.body);
               const std::string name = fields.Text("name", 1, kMaxName);
               std::string password = fields.Text("password", 1, kMaxPassword);
               fields.Finish();
               LogIn(request, name, std::move(password), /*form=*/false, respond);
             });
  routes.Add("POST", "/login", Permission::kNone, BodyKind::kForm,
             [this](const Request& request, const Respond& respond) {
               auto form = ParseForm(request.body);
               if (!form || !IsPlainText((*form)["name"]) || (*form)["name"].size() > kMaxName ||
                   (*form)["password"].size() > kMaxPassword) {
                 return respond(ErrorResponse(400, "expected the fields name and password"));
               }
               LogIn(request, (*form)["name"], (*form)["password"], /*form=*/true, respond);
             });
  add("POST", "/api/v1/logout", Permission::kLogin, BodyKind::kNone, &Accounts::LogOut);
  routes.Read("/api/v1/session", Permission::kLogin,
              [this](const Request& request) { return DescribeSession(request); });
  add("GET", "/api/v1/session/last-login", Permission::kLogin, BodyKind::kNone,
      &Accounts::ShowLastLogin);
  add("POST", "/api/v1/session/password", Permission::kLogin, BodyKind::kJson,
      &Accounts::ChangeOwnPassword);
  add("PUT", "/api/v1/session/preferences", Permission::kLogin, BodyKind::kJson,
      &Accounts::SetPreferences);
  routes.Read("/api/v1/certificate", Permission::kSettings,
              [this](const Request&) { return DescribeCertificate(); });
  add("PUT", "/api/v1/certificate", Permission::kSettings, BodyKind::kJson,
      &Accounts::ReplaceCertificate);
  add("POST", "/api/v1/certificate/new", Permission::kSettings, BodyKind::kJson,
      &Accounts::MakeNewCertificate);
  routes.Read("/api/v1/users", Permission::kUsers, [this](const Request&) {
    return JsonResponse({{"users", users_.Users()}});
  });
  add("POST", "/api/v1/users", Permission::kUsers, BodyKind::kJson, &Accounts::AddUser);
  add("PUT", "/api/v1/users/{name}", Permission::kUsers, BodyKind::kJson, &Accounts::ChangeUser);
}

void Accounts::HashThen(std::string password, const Respond& respond,
                        std::function<void(const std::string&)> then) {
  const bool accepted =
      worker_.Hash(std::move(password),
                   [respond, then = std::move(then)](const std::optional<std::string>& hash) {
                     if (!hash)
                       return respond(ErrorResponse(
                           503, "not enough memory to hash a password; try again later"));
                     RespondGuarded(
                         "password", [&] { then(*hash); }, respond);
                   });
  if (!accepted) respond(Busy());
}

Response Accounts::Welcome(const User& user, bool form) {
  if (form && IsFirst(user.password_hash)) return Redirect("/result?first=1");
  const Sessions::Opened opened = sessions_.Open(user, options_.now());
  opened.session->must_change_password = IsFirst(user.password_hash);
  Response response =
      form ? Redirect("/result") : JsonResponse({{"user", user.name}, {"role", Name(user.role)}});
  SetDeviceCookie(response, user.name, user.password_hash);
  SetCookie(response, cookie_name(), opened.token, certificate_.has_value());
  return response;
}

void Accounts::SetUp(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string code = fields.Text("code", 9, 9);
  const std::string name = ReadName(fields);
  std::string password = ReadNewPassword(fields, name);
  fields.Finish();
  if (!needs_setup() || setting_up_)
    return respond(ErrorResponse(409, "this appliance is set up already; log in"));
  const auto now = options_.now();
  // Counted by address, so that nobody can keep the owner out with wrong codes, and over all
  // addresses except this machine's own: 2^40 codes are safe from a thousand guesses a minute.
  const std::string key = "setup " + NetworkOf(request.address), all = "setup";
  const bool is_local = IsLocalAddress(request.address);
  auto wait = limiter_.Wait(key, now);
  if (!is_local) wait = std::max(wait, limiter_.Wait(all, now, kMaxSetupGuesses));
  if (wait.count() > 0)
    return respond(RetryLater(
        429, fmt::format("too many wrong setup codes; wait {} seconds", wait.count()), wait));
  if (!SameText(code, setup_code_)) {
    limiter_.Failed(key, now);
    if (!is_local) limiter_.Failed(all, now, kMaxSetupGuesses);
    audit_.Log(request.actor(), "setup.failed", "", "wrong code");
    return respond(ErrorResponse(
        403, "the setup code is wrong; it is printed on the console and in the journal"));
  }
  setting_up_ = true;
  const Actor actor{name, request.address};
  const Respond finish = [this, respond](Response response) {
    setting_up_ = false;
    respond(std::move(response));
  };
  HashThen(std::move(password), finish, [this, name, actor, finish](const std::string& hash) {
    const User user{name, Role::kEngineer, hash, false, WallClock::now()};
    users_.AddUser(actor, user, WhileAlive([this, user, finish](const Change& change) {
                     if (change.result != ChangeResult::kDone)
                       return finish(ChangeResponse(change));
                     setup_code_.clear();
                     finish(Welcome(user, /*form=*/false));
                   }));
  });
}

void Accounts::SetDeviceCookie(Response& response, const std::string& user,
                               const std::string& stored) const {
  constexpr std::chrono::hours kYear{365 * 24};
  SetCookie(response, devices_.NameFor(user), devices_.Make(user, stored), certificate_.has_value(),
            kYear);
}

std::vector<std::string> Accounts::CountersOf(const Request& request, const std::string& name,
                                              const std::string& stored) const {
  const auto cookie = CookieValue(request.Header("cookie"), devices_.NameFor(name));
  if (const auto device = cookie ? devices_.Identify(*cookie, name, stored) : std::nullopt)
    return {"device " + *device};
  return {"address " + NetworkOf(request.address), "name " + name};
}

std::optional<Response> Accounts::CountGuess(const std::vector<std::string>& counters) {
  const auto now = options_.now();
  std::chrono::seconds wait{0};
  for (const std::string& counter : counters) wait = std::max(wait, limiter_.Wait(counter, now));
  if (wait.count() > 0)
    return RetryLater(429, fmt::format("too many wrong passwords; wait {} seconds", wait.count()),
                      wait);
  // Counted before hashing, so that many guesses sent at once are as slow as one after the other.
  for (const std::string& counter : counters) limiter_.Failed(counter, now);
  return std::nullopt;
}

void Accounts::LogIn(const Request& request, const std::string& name, std::string password,
                     bool form, const Respond& respond) {
  const auto user = users_.FindUser(name);
  const std::string stored = user && !user->disabled ? user->password_hash : std::string();
  const std::vector<std::string> counters = CountersOf(request, name, stored);
  if (auto refusal = CountGuess(counters)) return respond(std::move(*refusal));
  if (!user) {
    if (const std::string why = users_.WhyUnreadable(); !why.empty())
      return respond(ErrorResponse(503, "nobody can log in: " + why));
  }
  const bool is_known = counters.size() == 1;
  const bool accepted = worker_.Verify(
      std::move(password), HashIn(stored), is_known,
      [this, actor = Actor{name, request.address}, stored, form, counters, respond](bool matches) {
        RespondGuarded(
            "login", [&] { FinishLogIn(actor, stored, matches, form, counters, respond); },
            respond);
      });
  if (!accepted) respond(Busy());
}

void Accounts::FinishLogIn(const Actor& actor, const std::string& stored, bool matches, bool form,
                           const std::vector<std::string>& counters, const Respond& respond) {
  const auto still = users_.FindUser(actor.user);
  if (!matches || !still || still->disabled || still->password_hash != stored) {
    // The name as typed is not logged, because people type passwords there.
    audit_.Log({still ? actor.user : std::string(), actor.address}, "login.failed", "", "");
    if (form) return respond(Redirect("/result?failed=1"));
    return respond(ErrorResponse(403, "name or password is wrong"));
  }
  for (const std::string& counter : counters) limiter_.Succeeded(counter);
  audit_.Log(actor, "login", "", "");
  respond(Welcome(*still, form));
}

void Accounts::LogOut(const Request& request, const Respond& respond) {
  sessions_.End(request.session);
  audit_.Log(request.actor(), "logout", "", "");
  Response response = JsonResponse(Json::object());
  SetCookie(response, cookie_name(), "", certificate_.has_value(), std::chrono::seconds(0));
  respond(std::move(response));
}

void Accounts::SetPreferences(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const Preferences wanted{.language = fields.Text("language", 1, 8),
                           .theme = fields.Text("theme", 1, 8)};
  fields.Finish();
  if (wanted.language != "en" && wanted.language != "es")
    throw DataError("language: expected en or es");
  if (wanted.theme != "dark" && wanted.theme != "light" && wanted.theme != "auto")
    throw DataError("theme: expected dark, light or auto");
  users_.SetPreferences(request.actor(), wanted, WhileAlive(Answer(respond)));
}

Response Accounts::DescribeSession(const Request& request) {
  const Preferences chosen = users_.PreferencesOf(request.session->user);
  const auto or_null = [](const std::string& text) {
    return text.empty() ? Json(nullptr) : Json(text);
  };
  Json permissions = Json::array();
  for (const Permission permission : PermissionsOf(request.session->role))
    permissions.push_back(Name(permission));
  return JsonResponse(
      {{"user", request.session->user},
       {"role", Name(request.session->role)},
       {"permissions", permissions},
       {"csrf_token", request.session->csrf_token},
       {"password_change_required", request.session->must_change_password},
       {"idle_logout_min", IdleLogout_min().value_or(idle_logout_min_)},
       {"preferences",
        {{"language", or_null(chosen.language)}, {"theme", or_null(chosen.theme)}}}});
}

void Accounts::ShowLastLogin(const Request& request, const Respond& respond) {
  // The entry of this login itself may be stamped shortly before or after the beginning of the
  // session.
  constexpr std::chrono::seconds kOwnEntry{2};
  const auto age =
      std::chrono::duration_cast<WallClock::duration>(options_.now() - request.session->begun);
  const WallClock::time_point begun = WallClock::now() - age - kOwnEntry;
  RespondInBackground(
      background_, "last login",
      [this, user = request.session->user, begun] {
        const LoginHistory history = LoginsBefore(audit_, user, begun);
        return JsonResponse({{"last", history.last ? Json{{"time", history.last->time},
                                                          {"address", history.last->address}}
                                                   : Json(nullptr)},
                             {"failed", history.failed}});
      },
      respond);
}

void Accounts::VerifyOwn(const Request& request, std::string password, const char* wrong,
                         const Respond& respond, std::function<void(const User&)> then) {
  const auto user = users_.FindUser(request.session->user);
  if (!user) return respond(ErrorResponse(409, "this account no longer exists"));
  // A separate counter, so that guesses at the login do not keep logged-in users from signing.
  const std::vector<std::string> counters = {"own " + user->name};
  if (auto refusal = CountGuess(counters)) return respond(std::move(*refusal));
  const bool accepted =
      worker_.Verify(std::move(password), HashIn(user->password_hash), /*trusted=*/true,
                     [this, user = *user, wrong, counters, session = request.session, respond,
                      then = std::move(then)](bool matches) {
                       if (!matches) return respond(ErrorResponse(403, wrong));
                       limiter_.Succeeded(counters.front());
                       if (session->ended)
                         return respond(ErrorResponse(401, "the session has ended: log in again"));
                       RespondGuarded(
                           "signature", [&] { then(user); }, respond);
                     });
  if (!accepted) respond(Busy());
}

void Accounts::ChangeOwnPassword(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  std::string old_password = fields.Text("old_password", 1, kMaxPassword);
  const std::string password = ReadNewPassword(fields, request.session->user);
  fields.Finish();
  if (password == old_password) throw DataError("the new password is the old one");
  VerifyOwn(
      request, std::move(old_password), "the old password is wrong", respond,
      [this, password, actor = request.actor(), session = request.session,
       respond](const User& user) {
        HashThen(password, respond, [this, user, actor, session, respond](const std::string& hash) {
          const UserChange wanted{.name = user.name,
                                  .role = {},
                                  .disabled = {},
                                  .password_hash = hash,
                                  .expected_hash = user.password_hash};
          users_.ChangeUser(
              actor, wanted,
              WhileAlive([this, name = user.name, hash, session, respond](const Change& change) {
                Response response = ChangeResponse(change);
                if (change.result == ChangeResult::kDone) {
                  sessions_.EndAllOf(name, session);
                  session->must_change_password = false;
                  SetDeviceCookie(response, name, hash);
                }
                respond(std::move(response));
              }));
        });
      });
}

void Accounts::AddUser(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  User user;
  user.name = ReadName(fields);
  user.role = ReadRole(fields);
  user.created_at = WallClock::now();
  std::string password = ReadNewPassword(fields, user.name);
  fields.Finish();
  HashThen(std::move(password), respond,
           [this, user, actor = request.actor(), respond](const std::string& hash) {
             User added = user;
             added.password_hash = std::string(kFirst) + hash;
             users_.AddUser(actor, added, [respond](const Change& change) {
               Response response = ChangeResponse(change);
               if (change.result == ChangeResult::kDone) response.status = 201;
               respond(std::move(response));
             });
           });
}

void Accounts::ChangeUser(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  if (!users_.FindUser(request.arguments.at(0)))
    return respond(ErrorResponse(404, "there is no account of this name"));
  UserChange change{.name = request.arguments.at(0),
                    .role = {},
                    .disabled = {},
                    .password_hash = {},
                    .expected_hash = {}};
  if (fields.Has("role")) change.role = ReadRole(fields);
  if (fields.Has("disabled")) change.disabled = fields.Flag("disabled");
  std::string password = fields.Has("password") ? fields.Text("password", 0, kMaxPassword)
                                                : std::string();  // empty: unchanged
  if (const std::string why = WhyNotPassword(password, change.name);
      !password.empty() && !why.empty())
    throw DataError(why);
  fields.Finish();
  const auto save = [this, actor = request.actor(), respond](const UserChange& what) {
    users_.ChangeUser(actor, what,
                      WhileAlive([this, name = what.name, respond](const Change& done) {
                        // The permissions of an account are fixed at login: its sessions end,
                        // including the user's own.
                        if (done.result == ChangeResult::kDone) sessions_.EndAllOf(name, nullptr);
                        respond(ChangeResponse(done));
                      }));
  };
  if (password.empty()) return save(change);
  const bool is_own = change.name == request.session->user;
  HashThen(std::move(password), respond, [save, change, is_own](const std::string& hash) {
    UserChange with_password = change;
    with_password.password_hash = is_own ? hash : std::string(kFirst) + hash;
    save(with_password);
  });
}

}  // namespace plumb::web

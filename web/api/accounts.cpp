// SPDX-License-Identifier: Apache-2.0
#include "web/api/accounts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <functional>
#include <utility>

#include "algo/base/errors.hpp"
#include "algo/base/names.hpp"
#include "algo/base/plain_text.hpp"
#include "web/api/look_back.hpp"
#include "web/exchange/json.hpp"
#include "web/exchange/routes.hpp"
#include "web/http/checks.hpp"
#include "web/http/connection_table.hpp"
#include "web/model/account.hpp"
#include "web/model/limits.hpp"
#include "web/model/plain_code.hpp"
#include "web/model/wall_clock.hpp"
#include "web/security/certificate_care.hpp"
#include "web/security/password_rules.hpp"
#include "web/security/secrets.hpp"
#include "web/security/stored_password.hpp"
#include "words/audit.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxCode = 32;  // of an authenticator, a screen, or for recovery
constexpr std::chrono::minutes kGuessesShown{10};
constexpr std::size_t kMaxSetupGuesses = 1000;  // a minute, from all addresses
std::string ReadNewPassword(Fields& fields, const std::string& user) {
  std::string password = fields.Text("password", kMinPassword, kMaxPassword);
  if (const Message why = WhyNotPassword(password, user); !why.empty()) throw DataError(why);
  return password;
}

std::string ReadName(Fields& fields) {
  std::string name = fields.Text("name", 1, kMaxName);
  const bool valid = IsName(name) && std::none_of(name.begin(), name.end(),
                                                  [](char c) { return c >= 'A' && c <= 'Z'; });
  if (!valid) throw DataError(say::web::AccountName());
  return name;
}

Role ReadRole(Fields& fields) {
  const auto role = Named<Role>(fields.Text("role", 1, kMaxName));
  if (!role || role == Role::kDisplay)  // which is paired and has no account
    throw DataError(say::web::AccountRole());
  return *role;
}

std::string OptionalCode(Fields& fields, const char* name) {
  return fields.Has(name) ? fields.Text(name, 0, kMaxCode) : std::string();
}

}  // namespace

Accounts::Accounts(const Services& services, const HttpServerOptions& options,
                   std::function<void(const TlsIdentity&)> serve_certificate)
    : users_(services.accounts),
      audit_(services.audit),
      settings_(services.settings),
      patients_(services.patients),
      references_(services.references),
      scans_(services.scans),
      monitoring_(services.monitoring),
      checks_(services.checks),
      room_(services.room),
      profiles_(services.profiles),
      updates_(services.updates),
      background_(services.background),
      options_(options),
      serve_certificate_(std::move(serve_certificate)),
      certificate_(options.tls),
      displays_(services.displays, options.tls.has_value(), options.now),
      devices_(options.device_key, options.tls.has_value()),
      worker_(options.password_operations, options.password_memory_bytes) {
  if (certificate_)
    certificate_end_ = FactsOfCertificate(certificate_->certificate_pem).valid_until;
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
    accounts_fault_ = MessageOf(error);
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

void Accounts::FollowSettings() {
  idle_logout_min_ = IdleLogout_min().value_or(idle_logout_min_);
  sessions_.SetLimits(std::chrono::minutes(idle_logout_min_), options_.session_limit);
}

void Accounts::Expire() {
  if (!accounts_fault_.empty()) LookForAccounts();
  FollowSettings();
  sessions_.Expire(options_.now());
  if (guessed_ && options_.now() - *guessed_ > kGuessesShown) NoteGuesses(false);
}

std::shared_ptr<Session> Accounts::SessionOf(const Request& request, bool touch) {
  const auto token = CookieValue(request.Header("cookie"), cookie_name());
  auto session = token ? sessions_.Find(*token, options_.now(), touch) : nullptr;
  // Only a connection that was made since then was shown the certificate.
  if (session && trial_ && request.connected_at > trial_->begun) KeepTriedCertificate();
  return session ? session : displays_.SessionOf(request);
}

Done Accounts::WhileAlive(Done done) const {
  return [alive = std::weak_ptr(alive_), done = std::move(done)](const Change& change) {
    if (!alive.expired()) done(change);
  };
}

void Accounts::AddRoutes(Routes& routes) {
  displays_.AddRoutes(routes);
  AddQuickLogInRoutes(routes);
  AddSecondFactorRoutes(routes);
  AddSessionRoutes(routes);
  AddSignedActs(routes);
  AddCertificateRoutes(routes);
  const auto add = [&](const char* method, const char* pattern, Permission permission,
                       BodyKind body, auto handler) {
    routes.Add(method, pattern, permission, body, std::bind_front(handler, this));
  };
  add("POST", "/api/v1/setup", Permission::kNone, BodyKind::kJson, &Accounts::SetUp);
  routes.Add("POST", "/api/v1/login", Permission::kNone, BodyKind::kJson,
             [this](const Request& request, const Respond& respond) {
               Fields fields(request.body);
               LogInForm form{.name = fields.Text("name", 1, kMaxName),
                              .password = fields.Text("password", 1, kMaxPassword),
                              .second_factor = OptionalCode(fields, "second_factor"),
                              .presence = OptionalCode(fields, "presence")};
               fields.Finish();
               LogIn(request, std::move(form), respond);
             });
  routes.Add("POST", "/login", Permission::kNone, BodyKind::kForm,
             [this](const Request& request, const Respond& respond) {
               auto form = ParseForm(request.body);
               if (!form || !IsPlainText((*form)["name"]) || (*form)["name"].size() > kMaxName ||
                   (*form)["password"].size() > kMaxPassword ||
                   (*form)["second_factor"].size() > kMaxCode ||
                   (*form)["presence"].size() > kMaxCode) {
                 return respond(ErrorResponse(400, say::web::NameAndPassword()));
               }
               LogIn(request,
                     {.name = (*form)["name"],
                      .password = (*form)["password"],
                      .second_factor = (*form)["second_factor"],
                      .presence = (*form)["presence"],
                      .is_form = true},
                     respond);
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
  routes.Read("/api/v1/users", Permission::kUsers, [this](const Request&) {
    return JsonResponse({{"users", users_.Users()}, {"directory", bool{options_.ask_directory}}});
  });
  add("POST", "/api/v1/users", Permission::kUsers, BodyKind::kJson, &Accounts::AddUser);
  add("PUT", "/api/v1/users/{name}", Permission::kUsers, BodyKind::kJson, &Accounts::ChangeUser);
}

void Accounts::AddCertificateRoutes(Routes& routes) {
  routes.Read("/authority.crt", Permission::kNone,
              [this](const Request&) { return SendAuthority(); });
  routes.Read("/api/v1/certificate", Permission::kSettings,
              [this](const Request&) { return DescribeCertificate(); });
  routes.Add("PUT", "/api/v1/certificate", Permission::kSettings, BodyKind::kJson,
             std::bind_front(&Accounts::ReplaceCertificate, this));
  routes.Add("POST", "/api/v1/certificate/new", Permission::kSettings, BodyKind::kJson,
             std::bind_front(&Accounts::MakeNewCertificate, this));
}

void Accounts::HashThen(std::string password, const Respond& respond,
                        std::function<void(const std::string&)> then) {
  const bool accepted =
      worker_.Hash(std::move(password),
                   [respond, then = std::move(then)](const std::optional<std::string>& hash) {
                     if (!hash) return respond(ErrorResponse(503, say::web::NoMemoryForPassword()));
                     RespondGuarded(
                         "password", [&] { then(*hash); }, respond);
                   });
  if (!accepted) respond(BusyWithPasswords());
}

void Accounts::SetUp(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string code = PlainCode(fields.Text("code", 1, 16));
  const std::string name = ReadName(fields);
  std::string password = ReadNewPassword(fields, name);
  fields.Finish();
  if (!needs_setup() || setting_up_) return respond(ErrorResponse(409, say::web::SetUpAlready()));
  const auto now = options_.now();
  // Counted by address, so that nobody can keep the owner out with wrong codes, and over all
  // addresses except this machine's own: 2^40 codes are safe from a thousand guesses a minute.
  const std::string key = "setup " + NetworkOf(request.address), all = "setup";
  const bool is_local = IsLocalAddress(request.address);
  auto wait = limiter_.Wait(key, now);
  if (!is_local) wait = std::max(wait, limiter_.Wait(all, now, kMaxSetupGuesses));
  if (wait.count() > 0)
    return respond(RetryLater(429, say::web::WaitAfterCodes(wait.count()), wait));
  if (!IsSameSecret(code, PlainCode(setup_code_))) {
    limiter_.Failed(key, now);
    if (!is_local) limiter_.Failed(all, now, kMaxSetupGuesses);
    audit_.Log(request.actor(), "setup.failed", "", say::audit::WrongSetupCode());
    return respond(ErrorResponse(403, say::web::WrongSetupCode()));
  }
  setting_up_ = true;
  const Actor actor{name, request.address};
  const Respond finish = [this, respond](Response response) {
    setting_up_ = false;
    respond(std::move(response));
  };
  HashThen(std::move(password), finish, [this, name, actor, finish](const std::string& hash) {
    const User user{name, Role::kEngineer, hash, false, WallClock::now()};
    users_.AddUser(actor, user, WhileAlive([this, user, actor, finish](const Change& change) {
                     if (change.result != ChangeResult::kDone)
                       return finish(ChangeResponse(change));
                     setup_code_.clear();
                     finish(Welcome(user, actor.address, /*form=*/false));
                   }));
  });
}

void Accounts::SetPreferences(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const Preferences wanted{.language = fields.Text("language", 1, 8),
                           .theme = fields.Text("theme", 1, 8)};
  fields.Finish();
  if (FindCatalogue(wanted.language) == nullptr)
    throw DataError(say::web::FieldLanguage(LanguageCodes()));
  if (wanted.theme != "dark" && wanted.theme != "light" && wanted.theme != "auto")
    throw DataError(say::web::FieldTheme());
  users_.SetPreferences(request.actor(), wanted, WhileAlive(Answer(respond)));
}

Response Accounts::DescribeSession(const Request& request) {
  FollowSettings();
  const Preferences chosen = users_.PreferencesOf(request.session->user);
  const auto user = users_.FindUser(request.session->user);
  const auto or_null = [](const std::string& text) {
    return text.empty() ? Json(nullptr) : Json(text);
  };
  Json permissions = Json::array();
  for (const Permission permission : PermissionsOf(request.session->role))
    if (request.session->May(permission)) permissions.push_back(Name(permission));
  return JsonResponse(
      {{"user", request.session->user},
       {"role", Name(request.session->role)},
       {"permissions", permissions},
       {"csrf_token", request.session->csrf_token},
       {"password_change_required", request.session->must_change_password},
       {"second_factor", user && user->has_second_factor},
       {"in_directory", user && IsInDirectory(user->password_hash)},
       {"is_quick", request.session->is_quick},
       {"has_pin", user && users_.FindPin(user->name)},
       {"idle_logout_min",
        std::chrono::duration_cast<std::chrono::minutes>(sessions_.IdleOf(request.session->role))
            .count()},
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
                             {"failed", history.failed},
                             {"changes", history.changes}});
      },
      respond);
}

OwnProof Accounts::ReadProof(Fields& fields, const char* password) {
  return {.password = fields.Text(password, 1, kMaxPassword),
          .second_factor = OptionalCode(fields, "second_factor")};
}

void Accounts::CheckPassword(std::string password, std::string hash, bool trusted,
                             const Respond& respond, std::function<void()> take_guess_back,
                             std::function<void(bool)> done) {
  const bool accepted = worker_.Verify(
      std::move(password), std::move(hash), trusted,
      [respond, take_guess_back, done = std::move(done)](std::optional<bool> matches) {
        if (!matches) {
          take_guess_back();
          return respond(ErrorResponse(503, say::web::NoMemoryForPassword()));
        }
        RespondGuarded(
            "password", [&] { done(*matches); }, respond);
      });
  if (accepted) return;
  take_guess_back();
  respond(BusyWithPasswords());
}

void Accounts::VerifyPassword(const User& user, std::string password,
                              const std::vector<std::string>& counters, const Respond& respond,
                              std::function<void(bool)> done) {
  if (!IsInDirectory(user.password_hash))
    return CheckPassword(
        std::move(password), HashIn(user.password_hash), /*trusted=*/true, respond,
        [this, counters] { TakeGuessBack(counters); }, std::move(done));
  if (!options_.ask_directory)
    return respond(ErrorResponse(503, say::web::DirectoryNotConfigured()));
  AskDirectoryOf(user.name, std::move(password), counters, respond,
                 [this, user, done, respond](const DirectoryAnswer& answer) {
                   if (!answer.refusal.empty()) return respond(ErrorResponse(403, answer.refusal));
                   if (answer.matches && answer.role != user.role) {
                     EndAllOf(user.name);
                     return respond(ErrorResponse(403, say::web::RoleChangedInDirectory()));
                   }
                   done(answer.matches);
                 });
}

void Accounts::VerifyOwn(const Request& request, OwnProof proof, const Message& wrong,
                         const Respond& respond, std::function<void(const User&)> then) {
  const auto user = users_.FindUser(request.session->user);
  if (!user) return respond(ErrorResponse(409, say::web::AccountGone()));
  // A separate counter, so that guesses at the login do not keep logged-in users from signing.
  const std::vector<std::string> counters = {"own " + user->name};
  if (auto refusal = CountGuess(counters)) return respond(std::move(*refusal));
  VerifyPassword(*user, std::move(proof.password), counters, respond,
                 [this, user = *user, wrong, counters, second_factor = proof.second_factor,
                  actor = request.actor(), session = request.session, respond,
                  then = std::move(then)](bool matches) {
                   if (!matches) return respond(ErrorResponse(403, wrong));
                   const auto signed_by = [this, user, counters, session, respond, then] {
                     limiter_.Succeeded(counters.front());
                     if (session->ended)
                       return respond(ErrorResponse(401, say::web::SessionEnded()));
                     then(user);
                   };
                   PassSecondFactor(actor, user, second_factor, respond, signed_by);
                 });
}

void Accounts::ChangeOwnPassword(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  OwnProof proof = ReadProof(fields, "old_password");
  const std::string password = ReadNewPassword(fields, request.session->user);
  fields.Finish();
  if (password == proof.password) throw DataError(say::web::PasswordIsOldOne());
  if (const auto user = users_.FindUser(request.session->user);
      user && IsInDirectory(user->password_hash))
    throw DataError(say::web::AccountOfDirectory());
  VerifyOwn(
      request, std::move(proof), say::web::WrongOldPassword(), respond,
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
                  quick_.EndAllOf(name);
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
  const auto password = std::make_shared<std::string>(ReadNewPassword(fields, user.name));
  OwnProof proof = ReadProof(fields, "own_password");
  fields.Finish();
  const auto add = [this, user, actor = request.actor(), respond](const std::string& hash) {
    User added = user;
    added.password_hash = std::string(kChosenByOthers) + hash;
    users_.AddUser(actor, added, [respond](const Change& change) {
      Response response = ChangeResponse(change);
      if (change.result == ChangeResult::kDone) response.status = 201;
      respond(std::move(response));
    });
  };
  VerifyOwn(request, std::move(proof), say::web::WrongPassword(), respond,
            [this, password, add, respond](const User&) {
              HashThen(std::move(*password), respond, add);
            });
}

void Accounts::ChangeUser(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::optional<User> user = users_.FindUser(request.arguments.at(0));
  if (!user) return respond(ErrorResponse(404, say::web::NoAccount()));
  UserChange change{.name = request.arguments.at(0),
                    .role = {},
                    .disabled = {},
                    .password_hash = {},
                    .expected_hash = {}};
  if (fields.Has("role")) change.role = ReadRole(fields);
  if (fields.Has("disabled")) change.disabled = fields.Flag("disabled");
  std::string password = fields.Has("password") ? fields.Text("password", 0, kMaxPassword)
                                                : std::string();  // empty: unchanged
  if (const Message why = WhyNotPassword(password, change.name); !password.empty() && !why.empty())
    throw DataError(why);
  // Without the directory such an account is of use again with a password of this unit's own.
  if (options_.ask_directory && IsInDirectory(user->password_hash) &&
      (change.role || !password.empty()))
    throw DataError(say::web::AccountOfDirectory());
  // An authenticator that was lost, with its recovery codes, is removed by an engineer.
  const bool removes_second_factor =
      fields.Has("remove_second_factor") && fields.Flag("remove_second_factor");
  OwnProof proof = ReadProof(fields, "own_password");
  fields.Finish();
  // With the old one beside it, and the person stays logged in.
  if (!password.empty() && change.name == request.session->user)
    throw DataError(say::web::OwnPasswordElsewhere());
  if (removes_second_factor && (change.role || change.disabled || !password.empty()))
    throw DataError(say::web::SecondFactorAlone());
  const auto save = [this, actor = request.actor(), respond](const UserChange& what) {
    users_.ChangeUser(actor, what,
                      WhileAlive([this, name = what.name, respond](const Change& done) {
                        // The permissions of an account are fixed at login: its sessions end,
                        // including the user's own.
                        if (done.result == ChangeResult::kDone) {
                          EndAllOf(name);
                        }
                        respond(ChangeResponse(done));
                      }));
  };
  const auto fresh = std::make_shared<std::string>(std::move(password));
  VerifyOwn(request, std::move(proof), say::web::WrongPassword(), respond,
            [this, fresh, save, change, removes_second_factor, actor = request.actor(),
             respond](const User&) {
              if (removes_second_factor) {
                const auto factor = users_.FindSecondFactor(change.name);
                users_.SetSecondFactor(actor, change.name, factor, std::nullopt,
                                       "user.second_factor_off", WhileAlive(Answer(respond)));
                return;
              }
              if (fresh->empty()) return save(change);
              HashThen(std::move(*fresh), respond, [save, change](const std::string& hash) {
                UserChange with_password = change;
                with_password.password_hash = std::string(kChosenByOthers) + hash;
                save(with_password);
              });
            });
}

}  // namespace plumb::web

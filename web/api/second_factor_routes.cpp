// SPDX-License-Identifier: Apache-2.0
// A person's own authenticator, and the list of their sessions.
#include <functional>

#include "algo/base/errors.hpp"
#include "web/api/accounts.hpp"
#include "web/exchange/json.hpp"
#include "web/exchange/routes.hpp"
#include "web/model/wall_clock.hpp"
#include "web/security/second_factor.hpp"
#include "words/web.hpp"

namespace plumb::web {

void Accounts::AddSecondFactorRoutes(Routes& routes) {
  const auto add = [&](const char* method, const char* pattern, auto handler) {
    routes.Add(method, pattern, Permission::kView, BodyKind::kJson, std::bind_front(handler, this));
  };
  add("POST", "/api/v1/session/second-factor/offer", &Accounts::OfferSecondFactor);
  add("POST", "/api/v1/session/second-factor", &Accounts::FinishSecondFactor);
  add("DELETE", "/api/v1/session/second-factor", &Accounts::RemoveSecondFactor);
}

void Accounts::OfferSecondFactor(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  OwnProof proof = ReadProof(fields, "password");
  fields.Finish();
  if (request.session->role == Role::kTechnician)
    return respond(ErrorResponse(403, say::web::RoleNotAllowed()));
  VerifyOwn(request, std::move(proof), say::web::WrongPassword(), respond,
            [session = request.session, respond](const User& user) {
              session->offered_secret = MakeTotpSecret();
              respond(JsonResponse({{"secret", session->offered_secret},
                                    {"uri", OtpauthUri(user.name, session->offered_secret)}}));
            });
}

void Accounts::FinishSecondFactor(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string code = fields.Text("code", 1, 16);
  fields.Finish();
  const std::string& user = request.session->user;
  if (request.session->offered_secret.empty())
    return respond(ErrorResponse(409, say::web::SecondFactorNotOffered()));
  if (auto refusal = CountGuess({"own " + user})) return respond(std::move(*refusal));
  const auto begun = UsedSecondFactor(
      {.secret = request.session->offered_secret, .last_step = 0, .recovery_hashes = {}}, code,
      WallClock::now());
  if (!begun) return respond(ErrorResponse(403, say::web::SecondFactorWrong()));
  limiter_.Succeeded("own " + user);
  const std::vector<std::string> codes = MakeRecoveryCodes();
  SecondFactor wanted = *begun;
  wanted.recovery_hashes = HashesOf(codes);
  users_.SetSecondFactor(
      request.actor(), user, users_.FindSecondFactor(user), wanted, "user.second_factor_on",
      WhileAlive([this, codes, user, session = request.session, respond](const Change& change) {
        if (change.result != ChangeResult::kDone) return respond(ChangeResponse(change));
        session->offered_secret.clear();
        sessions_.EndAllOf(user, session);  // those began with the password alone
        respond(JsonResponse({{"recovery_codes", codes}}));
      }));
}

void Accounts::RemoveSecondFactor(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  OwnProof proof = ReadProof(fields, "password");
  fields.Finish();
  VerifyOwn(request, std::move(proof), say::web::WrongPassword(), respond,
            [this, actor = request.actor(), respond](const User& user) {
              // Read again: signing has just used up a code.
              users_.SetSecondFactor(actor, user.name, users_.FindSecondFactor(user.name),
                                     std::nullopt, "user.second_factor_off",
                                     WhileAlive(Answer(respond)));
            });
}

void Accounts::AddSessionRoutes(Routes& routes) {
  routes.Read("/api/v1/displays/presence", Permission::kRoom,
              [this](const Request& request) { return DescribePresence(request); });
  routes.Read("/api/v1/session/list", Permission::kView,
              [this](const Request& request) { return ListSessions(request); });
  routes.Add("DELETE", "/api/v1/session/list/{id}", Permission::kView, BodyKind::kNone,
             std::bind_front(&Accounts::EndSession, this));
  routes.Add("POST", "/api/v1/session/end-others", Permission::kView, BodyKind::kNone,
             std::bind_front(&Accounts::EndOtherSessions, this));
}

Response Accounts::ListSessions(const Request& request) {
  const auto now = options_.now();
  const auto before_s = [now](std::chrono::steady_clock::time_point time) {
    return std::chrono::duration_cast<std::chrono::seconds>(now - time).count();
  };
  Json list = Json::array();
  for (const auto& session : sessions_.Of(request.session->user))
    list.push_back({{"id", session->id},
                    {"address", session->address},
                    {"begun_s_ago", before_s(session->begun)},
                    {"used_s_ago", before_s(session->last_used)},
                    {"is_this", session == request.session}});
  return JsonResponse({{"sessions", list}});
}

void Accounts::EndSession(const Request& request, const Respond& respond) {
  for (const auto& session : sessions_.Of(request.session->user)) {
    if (session->id != request.arguments.at(0)) continue;
    sessions_.End(session);
    audit_.Log(request.actor(), "session.end_other", "", {});
    return respond(JsonResponse(Json::object()));
  }
  respond(ErrorResponse(404, say::web::NoSession()));
}

void Accounts::EndOtherSessions(const Request& request, const Respond& respond) {
  sessions_.EndAllOf(request.session->user, request.session);
  audit_.Log(request.actor(), "session.end_other", "", {});
  respond(JsonResponse(Json::object()));
}

}  // namespace plumb::web

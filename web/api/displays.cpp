#include "web/api/displays.hpp"

#include <fmt/format.h>
#include <sodium.h>

#include <algorithm>
#include <utility>

#include "web/api/accounts.hpp"
#include "web/api/json.hpp"
#include "web/http/checks.hpp"
#include "web/model/account.hpp"
#include "web/model/limits.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxWaiting = 8;
constexpr std::chrono::minutes kWaitsFor{10};
constexpr std::chrono::seconds kReloadInterval{5};
constexpr int kMaxWrongCodes = 20;
constexpr int kCookieAge_s =
    400 * 24 * 3600;  // the longest that browsers keep a cookie; renewed at each use

/// Six letters that are not easily confused: 30 bits, for ten minutes.
std::string MakeCode() {
  constexpr std::string_view kLetters = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ";
  std::string code;
  for (int i = 0; i < 6; ++i) {
    if (i == 3) code += '-';
    code += kLetters[randombytes_uniform(static_cast<std::uint32_t>(kLetters.size()))];
  }
  return code;
}

}  // namespace

Displays::Displays(DisplayService& service, bool tls, std::function<TimePoint()> now)
    : service_(service), tls_(tls), now_(std::move(now)) {
  Load();
}

/// Sessions of removed displays end at once, and so do their streams.
void Displays::Load() {
  std::map<std::string, std::shared_ptr<Session>> sessions;
  for (const Display& display : service_.Displays()) {
    auto& session = sessions[display.token_hash];
    const auto known = sessions_.find(display.token_hash);
    session = known != sessions_.end()
                  ? known->second
                  : std::make_shared<Session>(Session{"display " + display.name, Role::kDisplay,
                                                      RandomToken(32), now_(), now_()});
  }
  for (const auto& [hash, session] : sessions_) session->ended = !sessions.contains(hash);
  sessions_ = std::move(sessions);
  loaded_ = now_();
}

std::shared_ptr<Session> Displays::SessionOf(const Request& request) {
  const auto token = CookieValue(request.Header("cookie"), cookie_name());
  if (!token || token->empty() || token->size() > 64) return nullptr;
  // A database that could not be opened at the start may have been opened since.
  if (sessions_.empty() && now_() - loaded_ >= kReloadInterval) Load();
  const auto found = sessions_.find(StoredHashOf(*token));
  return found == sessions_.end() ? nullptr : found->second;
}

void Displays::Expire() {
  std::erase_if(pairings_,
                [&](const Pairing& pairing) { return now_() - pairing.begun > kWaitsFor; });
  if (pairings_.empty()) wrong_codes_ = 0;
}

void Displays::AddRoutes(Router& router) {
  const auto bind = [this](void (Displays::*handler)(const Request&, const Respond&)) {
    return [this, handler](const Request& request, const Respond& respond) {
      (this->*handler)(request, respond);
    };
  };
  router.Add({"POST", "/api/v1/displays/pair", Permission::kNone, BodyKind::kNone,
              bind(&Displays::Begin)});
  router.Add({"POST", "/api/v1/displays/claim", Permission::kNone, BodyKind::kJson,
              bind(&Displays::Claim)});
  router.Add(
      {"GET", "/api/v1/displays", Permission::kUsers, BodyKind::kNone, bind(&Displays::List)});
  router.Add(
      {"POST", "/api/v1/displays", Permission::kUsers, BodyKind::kJson, bind(&Displays::Approve)});
  router.Add({"DELETE", "/api/v1/displays/{id}", Permission::kUsers, BodyKind::kNone,
              bind(&Displays::Remove)});
}

void Displays::Begin(const Request&, const Respond& respond) {
  Expire();
  if (pairings_.size() >= kMaxWaiting)
    return respond(
        ErrorResponse(503, "too many screens are waiting to be paired; try again later"));
  const std::string token = RandomToken(32);
  pairings_.push_back({.code = MakeCode(), .token_hash = StoredHashOf(token), .begun = now_()});
  Response response;
  response.body = Dump({{"code", pairings_.back().code}, {"secret", token}});
  respond(std::move(response));
}

void Displays::Claim(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string token = fields.Text("secret", 1, 64);
  fields.Finish();
  Expire();
  const std::string hash = StoredHashOf(token);
  if (sessions_.contains(hash)) {
    Response response;
    response.headers.emplace_back(
        "Set-Cookie", fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict; Max-Age={}{}",
                                  cookie_name(), token, kCookieAge_s, tls_ ? "; Secure" : ""));
    response.body = Dump({{"paired", true}});
    return respond(std::move(response));
  }
  const bool waits = std::any_of(pairings_.begin(), pairings_.end(), [&](const Pairing& pairing) {
    return pairing.token_hash == hash;
  });
  if (!waits) return respond(ErrorResponse(404, "this pairing has expired: start again"));
  Response response;
  response.body = Dump({{"paired", false}});
  respond(std::move(response));
}

void Displays::Approve(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  std::string code = fields.Text("code", 1, 16);
  const std::string name = fields.Text("name", 1, kMaxName);
  fields.Finish();
  Expire();
  std::transform(code.begin(), code.end(), code.begin(),
                 [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 32) : c; });
  const auto found = std::find_if(pairings_.begin(), pairings_.end(),
                                  [&](const Pairing& pairing) { return pairing.code == code; });
  if (found == pairings_.end()) {
    if (++wrong_codes_ > kMaxWrongCodes) pairings_.clear();
    return respond(ErrorResponse(404, "no screen shows this code; a code is valid for 10 minutes"));
  }
  static_assert(kMaxDisplays == 20);  // The page translates the sentence with its number.
  if (service_.Displays().size() >= kMaxDisplays)
    return respond(ErrorResponse(409, "20 screens are paired already: remove one first"));
  const Display display{.id = {},
                        .name = name,
                        .token_hash = found->token_hash,
                        .paired_at = WallClock::now(),
                        .paired_by = request.actor().user};
  pairings_.erase(found);
  service_.AddDisplay(request.actor(), display,
                      [this, alive = std::weak_ptr(alive_), respond](const Change& change) {
                        if (alive.expired()) return;
                        Load();
                        respond(ChangeResponse(change));
                      });
}

void Displays::List(const Request&, const Respond& respond) {
  Json list = Json::array();
  for (const Display& display : service_.Displays()) {
    list.push_back(Json{{"id", display.id},
                        {"name", display.name},
                        {"paired_at", TimeText(display.paired_at)},
                        {"paired_by", display.paired_by}});
  }
  Response response;
  response.body = Dump({{"displays", list}});
  respond(std::move(response));
}

void Displays::Remove(const Request& request, const Respond& respond) {
  service_.RemoveDisplay(request.actor(), request.arguments.at(0),
                         [this, alive = std::weak_ptr(alive_), respond](const Change& change) {
                           if (alive.expired()) return;
                           Load();
                           respond(ChangeResponse(change));
                         });
}

}  // namespace plumb::web

// SPDX-License-Identifier: Apache-2.0
#include "web/api/displays.hpp"

#include <algorithm>
#include <functional>
#include <utility>

#include "web/exchange/json.hpp"
#include "web/http/checks.hpp"
#include "web/model/account.hpp"
#include "web/model/limits.hpp"
#include "web/model/plain_code.hpp"
#include "web/model/wall_clock.hpp"
#include "web/security/secrets.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxWaiting = 8;
constexpr std::size_t kMaxOfAddress = 2;  // a screen whose page was loaded again counts twice
constexpr std::chrono::minutes kWaitsFor{10};
constexpr std::chrono::seconds kReloadInterval{5};
constexpr int kMaxWrongCodes = 20;
/// The longest that browsers keep a cookie; it is renewed at each use.
constexpr std::chrono::hours kCookieAge{400 * 24};

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

void Displays::AddRoutes(Routes& routes) {
  routes.Read("/api/v1/displays", Permission::kUsers, [this](const Request&) { return List(); });
  const auto add = [&](const char* method, const char* pattern, Permission permission,
                       BodyKind body, auto handler) {
    routes.Add(method, pattern, permission, body, std::bind_front(handler, this));
  };
  add("POST", "/api/v1/displays/pair", Permission::kNone, BodyKind::kNone, &Displays::Begin);
  add("POST", "/api/v1/displays/claim", Permission::kNone, BodyKind::kJson, &Displays::Claim);
}

void Displays::MakeRoomFor(const std::string& address) {
  std::map<std::string, std::size_t> counts;
  for (const Pairing& pairing : pairings_) ++counts[pairing.address];
  // A newcomer replaces the oldest pairing of its own address, or of the address with the most, so
  // that nobody can keep other screens out by asking again and again.
  std::string from;
  if (counts[address] >= kMaxOfAddress) {
    from = address;
  } else if (pairings_.size() >= kMaxWaiting) {
    from = std::max_element(counts.begin(), counts.end(), [](const auto& a, const auto& b) {
             return a.second < b.second;
           })->first;
  } else {
    return;
  }
  pairings_.erase(std::find_if(pairings_.begin(), pairings_.end(),
                               [&](const Pairing& pairing) { return pairing.address == from; }));
}

void Displays::Begin(const Request& request, const Respond& respond) {
  Expire();
  const std::string address = NetworkOf(request.address);
  MakeRoomFor(address);
  const std::string token = RandomToken(32);
  pairings_.push_back({.code = RandomCode(6),
                       .token_hash = StoredHashOf(token),
                       .begun = now_(),
                       .address = address});
  respond(JsonResponse({{"code", pairings_.back().code}, {"secret", token}}));
}

void Displays::Claim(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string token = fields.Text("secret", 1, 64);
  fields.Finish();
  Expire();
  const std::string hash = StoredHashOf(token);
  if (sessions_.contains(hash)) {
    Response response = JsonResponse({{"paired", true}});
    SetCookie(response, cookie_name(), token, tls_, kCookieAge);
    return respond(std::move(response));
  }
  const bool waits = std::any_of(pairings_.begin(), pairings_.end(), [&](const Pairing& pairing) {
    return pairing.token_hash == hash;
  });
  if (!waits) return respond(ErrorResponse(404, say::web::PairingExpired()));
  respond(JsonResponse({{"paired", false}}));
}

void Displays::Approve(const Actor& actor, const std::string& code, const std::string& name,
                       const Done& done) {
  Expire();
  const auto found = std::find_if(pairings_.begin(), pairings_.end(), [&](const Pairing& pairing) {
    return PlainCode(pairing.code) == PlainCode(code);
  });
  if (found == pairings_.end()) {
    if (++wrong_codes_ > kMaxWrongCodes) pairings_.clear();
    return done(Refused(ChangeResult::kNotFound, say::web::NoScreenShowsCode()));
  }
  if (service_.Displays().size() >= kMaxDisplays)
    return done(Refused(ChangeResult::kConflict, say::web::ScreensPaired(kMaxDisplays)));
  const Display display{.id = {},
                        .name = name,
                        .token_hash = found->token_hash,
                        .paired_at = WallClock::now(),
                        .paired_by = actor.user};
  pairings_.erase(found);
  service_.AddDisplay(actor, display, LoadThen(done));
}

Response Displays::List() {
  Json list = Json::array();
  for (const Display& display : service_.Displays()) {
    list.push_back(Json{{"id", display.id},
                        {"name", display.name},
                        {"paired_at", display.paired_at},
                        {"paired_by", display.paired_by}});
  }
  return JsonResponse({{"displays", list}});
}

void Displays::Remove(const Actor& actor, const std::string& id, const Done& done) {
  service_.RemoveDisplay(actor, id, LoadThen(done));
}

Done Displays::LoadThen(const Done& done) {
  return [this, alive = std::weak_ptr(alive_), done](const Change& change) {
    if (alive.expired()) return;
    Load();
    done(change);
  };
}

}  // namespace plumb::web

// SPDX-License-Identifier: Apache-2.0
#include "daemon/peers/peer_watch.hpp"

#include <cstddef>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "daemon/loop/log.hpp"
#include "daemon/network/transfer.hpp"
#include "web/security/patient_hash.hpp"
#include "words/peers.hpp"

namespace plumb {
namespace {

constexpr std::chrono::milliseconds kPeerConnects{2000}, kPeerAnswers{3000};
constexpr std::size_t kMostPeerAnswer = 256;

/// HOST:PORT of an address, by which people know a unit.
std::string NameOfUnit(const std::string& url) { return url.substr(url.find("://") + 3); }

/// Takes a short answer; a longer one ends the transfer.
std::size_t TakeAnswer(const char* data, std::size_t, std::size_t count, void* to) {
  std::string& answer = *static_cast<std::string*>(to);
  if (answer.size() + count > kMostPeerAnswer) return 0;
  answer.append(data, count);
  return count;
}

}  // namespace

PeerWatch::PeerWatch(EventLoop& loop, const PeersSettings& settings, const std::string& secret,
                     std::function<void(const Message&)> changed,
                     std::chrono::milliseconds ask_every)
    : loop_(loop),
      settings_(settings),
      secret_(secret),
      changed_(std::move(changed)),
      ask_every_(ask_every) {
  if (secret.empty()) return;
  note_ = alive_.WhileAlive(
      [this](std::size_t peer, int opening, Answer answer) { Note(peer, opening, answer); });
  for (const std::string& url : settings.units)
    peers_.push_back({.url = url, .name = NameOfUnit(url), .thread = {}});
  for (std::size_t i = 0; i < peers_.size(); ++i)
    peers_[i].thread = std::jthread(
        [this, i, url = peers_[i].url](const std::stop_token& stop) { AskAgain(stop, i, url); });
}

PeerWatch::~PeerWatch() {
  for (Peer& peer : peers_) peer.thread.request_stop();
}

void PeerWatch::SetOpen(const std::string& session, const std::string& code) {
  session_ = session;
  const bool had_notes = !notes().empty();
  for (Peer& peer : peers_) {
    peer.answer = Answer::kNone;
    peer.was_open = false;
  }
  {
    const std::lock_guard lock(mutex_);
    code_ = code;
    ++opening_;
  }
  opened_.notify_all();
  if (had_notes) changed_({});
}

void PeerWatch::AskAgain(const std::stop_token& stop, std::size_t peer, const std::string& url) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    const int opening = opening_;
    const std::string code = code_;
    if (!code.empty()) {
      lock.unlock();
      const Answer answer = Ask(url, code, stop);
      if (stop.stop_requested()) return;
      loop_.Post("peers", [note = note_, peer, opening, answer] { note(peer, opening, answer); });
      lock.lock();
    }
    const auto is_other = [&] { return opening_ != opening; };
    if (code.empty())
      opened_.wait(lock, stop, is_other);
    else
      opened_.wait_for(lock, stop, ask_every_, is_other);
  }
}

PeerWatch::Answer PeerWatch::Ask(const std::string& url, const std::string& code,
                                 const std::stop_token& stop) const {
  Transfer transfer(url + "/peers/open?patient=" + web::PatientHash(code, secret_), "https,http",
                    settings_.trusted, stop);
  transfer.SetLimits(kPeerConnects, kPeerAnswers);
  transfer.AddHeader("Authorization: Bearer " + secret_);
  transfer.AddHeader("User-Agent: plumbd");
  std::string body;
  transfer.Set(CURLOPT_WRITEFUNCTION, &TakeAnswer);
  transfer.Set(CURLOPT_WRITEDATA, static_cast<void*>(&body));
  if (!transfer.Perform().empty() || transfer.status() != 200) return Answer::kNotKnown;
  const auto json = nlohmann::json::parse(body, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || !json.contains("open") || !json["open"].is_boolean())
    return Answer::kNotKnown;
  return json["open"].get<bool>() ? Answer::kOpen : Answer::kClosed;
}

void PeerWatch::Note(std::size_t peer, int opening, Answer answer) {
  {
    const std::lock_guard lock(mutex_);
    if (opening != opening_) return;
  }
  Peer& one = peers_[peer];
  const Answer before = std::exchange(one.answer, answer);
  if (before == answer) return;
  const Message said = answer == Answer::kOpen       ? say::peers::OpenElsewhere(one.name)
                       : answer == Answer::kNotKnown ? say::peers::NotKnown(one.name)
                                                     : Message();
  if (!said.empty())
    Log(LogLevel::kWarning, said.English());
  else if (before != Answer::kNone)
    Log(LogLevel::kNotice, fmt::format("the open patient is not open in {}", one.name));
  // A network that comes and goes finds nothing new each time.
  const bool is_news = answer == Answer::kOpen && !one.was_open;
  if (answer != Answer::kNotKnown) one.was_open = answer == Answer::kOpen;
  if (!said.empty() || before != Answer::kNone) changed_(is_news ? said : Message());
}

std::vector<Message> PeerWatch::notes() const {
  std::vector<Message> notes;
  for (const Peer& peer : peers_)
    if (peer.answer == Answer::kOpen) notes.push_back(say::peers::OpenElsewhere(peer.name));
  for (const Peer& peer : peers_)
    if (peer.answer == Answer::kNotKnown) notes.push_back(say::peers::NotKnown(peer.name));
  return notes;
}

}  // namespace plumb

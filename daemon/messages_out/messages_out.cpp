// SPDX-License-Identifier: Apache-2.0
#include "daemon/messages_out/messages_out.hpp"

#include <sodium.h>
#include <unistd.h>

#include <array>
#include <ctime>
#include <utility>

#include <fmt/format.h>

#include "daemon/loop/log.hpp"
#include "daemon/messages_out/senders.hpp"
#include "words/messages.hpp"

namespace plumb {
namespace {

/// The machine's name as far as it may stand in a header of syslog.
std::string UnitName() {
  std::array<char, 256> name{};
  (void)::gethostname(name.data(), name.size() - 1);
  std::string plain;
  for (const char c : std::string(name.data()))
    if (c > ' ' && c <= '~') plain += c;
  return plain.empty() ? "-" : plain;
}

std::string NewMessageId() {
  std::array<unsigned char, 16> bytes{};
  randombytes_buf(bytes.data(), bytes.size());
  return fmt::format("{:02x}", fmt::join(bytes, ""));
}

std::tm LocalTime(WallClock::time_point now) {
  const std::time_t seconds = WallClock::to_time_t(now);
  std::tm local{};
  ::localtime_r(&seconds, &local);
  return local;
}

Message NameOf(const std::string& way) {
  if (way == "mail") return say::messages::Mail();
  return way == "syslog" ? say::messages::Syslog() : say::messages::Webhook();
}

}  // namespace

MessagesOut::MessagesOut(EventLoop& loop, const MessagesSettings& settings, OccasionRules rules,
                         std::function<void()> changed, RetryPauses pauses)
    : loop_(loop), settings_(settings), rules_(rules), changed_(std::move(changed)) {
  if (!settings.mail_to.empty()) Add("mail", SendMail, pauses);
  if (!settings.syslog.empty()) Add("syslog", SendSyslog, pauses);
  if (!settings.webhook.empty()) Add("webhook", SendWebhook, pauses);
}

void MessagesOut::Add(const char* name, Send send, const RetryPauses& pauses) {
  const std::size_t way = ways_.size();
  const auto report =
      alive_.WhileAlive([this, way](const Courier::Attempt& attempt) { Note(way, attempt); });
  ways_.push_back(
      {.status = {.name = name},
       .courier = std::make_unique<Courier>(
           [send, settings = settings_](const OutMessage& message, const std::stop_token& stop) {
             return send(message, settings, stop);
           },
           pauses,
           [&loop = loop_, report](const Courier::Attempt& attempt) {
             loop.Post("messages", [report, attempt] { report(attempt); });
           })});
}

void MessagesOut::Look(const Status& status, OccasionMemory::Time now) {
  if (ways_.empty()) return;
  const auto time = WallClock::now();
  const double up_s = std::chrono::duration<double>(now - started_).count();
  const std::vector<Occasion> present = OccasionsOf(status, rules_, up_s, time, LocalTime(time));
  for (const OccasionMemory::Told& told : memory_.ToTell(present, now))
    Post({.id = NewMessageId(),
          .unit = UnitName(),
          .time = time,
          .kind = told.occasion.kind,
          .is_repeated = told.is_repeated,
          .text = told.occasion.text},
         {});
}

void MessagesOut::Test(std::function<void(const Message&)> done) {
  if (ways_.empty()) return done(say::messages::NoWay());
  Post({.id = NewMessageId(),
        .unit = UnitName(),
        .time = WallClock::now(),
        .kind = OccasionKind::kTest,
        .text = say::messages::Test()},
       std::move(done));
}

void MessagesOut::Post(OutMessage message, std::function<void(const Message&)> done) {
  const bool is_test = static_cast<bool>(done);
  Open& open = open_[message.id];
  open.kind = message.kind;
  open.ways = ways_.size();
  open.done = std::move(done);
  Log(LogLevel::kNotice,
      fmt::format("message out ({}): {}", Name(message.kind), message.text.English()));
  for (std::size_t i = 0; i < ways_.size(); ++i) {
    if (ways_[i].courier->Post(message, is_test)) continue;
    Note(i, {.id = message.id,
             .failure = say::messages::TooManyWaiting().English(),
             .is_given_up = true});
  }
}

void MessagesOut::Note(std::size_t way, const Courier::Attempt& attempt) {
  MessageWay& status = ways_[way].status;
  if (attempt.failure.empty()) {
    ++status.sent;
    status.failure = {};
    status.sent_at = WallClock::now();
  } else {
    status.failure = say::messages::NotDelivered(NameOf(status.name), attempt.failure);
    status.failed += attempt.is_given_up ? 1 : 0;
    Log(LogLevel::kWarning, status.failure.English());
  }
  if (attempt.failure.empty() || attempt.is_given_up) End(attempt.id, status.failure);
  changed_();
}

void MessagesOut::End(const std::string& id, const Message& failure) {
  const auto found = open_.find(id);
  if (found == open_.end()) return;
  Open& open = found->second;
  if (failure.empty()) {
    open.is_taken = true;
  } else {
    open.failure = failure;
  }
  if (--open.ways > 0) return;
  const Open ended = std::move(open);
  open_.erase(found);
  if (ended.done) {
    ended.done(ended.failure);
  } else if (!ended.is_taken) {
    memory_.NotTold(ended.kind);
  }
}

std::vector<MessageWay> MessagesOut::status() const {
  std::vector<MessageWay> all;
  for (const Way& way : ways_) {
    all.push_back(way.status);
    all.back().waiting = static_cast<std::int64_t>(way.courier->num_waiting());
  }
  return all;
}

}  // namespace plumb

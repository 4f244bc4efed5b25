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

void MessagesOut::Look(const Status& status) {
  if (ways_.empty()) return;
  const auto now = WallClock::now();
  const auto steady = std::chrono::steady_clock::now();
  const double up_s = std::chrono::duration<double>(steady - started_).count();
  const std::vector<Occasion> present = OccasionsOf(status, rules_, up_s, now, LocalTime(now));
  for (const OccasionMemory::Told& told : memory_.ToTell(present, steady))
    Post({.id = NewMessageId(),
          .unit = UnitName(),
          .time = now,
          .kind = told.occasion.kind,
          .is_repeated = told.is_repeated,
          .text = told.occasion.text},
         /*is_test=*/false);
}

void MessagesOut::Test(std::function<void(const Message&)> done) {
  if (ways_.empty()) return done(say::messages::NoWay());
  OutMessage message{.id = NewMessageId(),
                     .unit = UnitName(),
                     .time = WallClock::now(),
                     .kind = OccasionKind::kTest,
                     .text = say::messages::Test()};
  tests_[message.id] = {.ways = ways_.size(), .failure = {}, .done = std::move(done)};
  Post(std::move(message), /*is_test=*/true);
}

void MessagesOut::Post(OutMessage message, bool is_test) {
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
  if (attempt.failure.empty() || attempt.is_given_up) EndTest(attempt.id, status.failure);
  changed_();
}

void MessagesOut::EndTest(const std::string& id, const Message& failure) {
  const auto found = tests_.find(id);
  if (found == tests_.end()) return;
  Open& open = found->second;
  if (!failure.empty()) open.failure = failure;
  if (--open.ways > 0) return;
  const Open ended = std::move(open);
  tests_.erase(found);
  ended.done(ended.failure);
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

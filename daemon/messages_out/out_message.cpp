// SPDX-License-Identifier: Apache-2.0
#include "daemon/messages_out/out_message.hpp"

#include <sodium.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <ctime>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/base64.hpp"
#include "algo/base/message_json.hpp"
#include "words/messages.hpp"

namespace plumb {
namespace {

constexpr int kLocal0 = 16, kWarning = 4, kNotice = 5;

std::string SaidTo(const OutMessage& message, const Catalogue& language) {
  return Text(message.is_repeated ? say::messages::StillSo(message.text) : message.text, language);
}

/// A header's text as encoded words (RFC 2047), each of whole characters and of at most 75 bytes.
std::string EncodedWords(std::string_view text) {
  constexpr std::size_t kMostBytes = 42;
  std::string words;
  while (!text.empty()) {
    std::size_t count = std::min(kMostBytes, text.size());
    while (count > 1 && count < text.size() &&
           (static_cast<unsigned char>(text[count]) & 0xC0U) == 0x80U)
      --count;
    if (!words.empty()) words += "\r\n ";
    words += fmt::format("=?UTF-8?B?{}?=", ToBase64(text.substr(0, count)));
    text.remove_prefix(count);
  }
  return words;
}

std::tm UtcOf(WallClock::time_point time) {
  const std::time_t seconds = WallClock::to_time_t(time);
  std::tm utc{};
  ::gmtime_r(&seconds, &utc);
  return utc;
}

int PriorityOf(const OutMessage& message) {
  return 8 * kLocal0 + (message.kind == OccasionKind::kTest ? kNotice : kWarning);
}

}  // namespace

std::string MailText(const OutMessage& message, const Catalogue& language, const std::string& from,
                     const std::string& to) {
  const std::string said = SaidTo(message, language);
  const std::string body = ToBase64(fmt::format(
      "{}\r\n\r\n{}\r\n", said, Text(say::messages::WhereToLook(message.unit), language)));
  // Names of days and months are those of the protocol, whatever the locale.
  constexpr std::array kDays = {"Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"};
  constexpr std::array kMonths = {"Jan", "Feb", "Mar", "Apr", "May", "Jun",
                                  "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"};
  const std::tm utc = UtcOf(message.time);
  std::string mail = fmt::format(
      "Date: {}, {:02} {} {} {:02}:{:02}:{:02} +0000\r\nFrom: <{}>\r\nTo: {}\r\nSubject: {}\r\n"
      "Message-ID: <{}@{}>\r\nAuto-Submitted: auto-generated\r\nMIME-Version: 1.0\r\n"
      "Content-Type: text/plain; charset=utf-8\r\nContent-Transfer-Encoding: base64\r\n\r\n",
      kDays.at(static_cast<std::size_t>(utc.tm_wday)), utc.tm_mday,
      kMonths.at(static_cast<std::size_t>(utc.tm_mon)), utc.tm_year + 1900, utc.tm_hour, utc.tm_min,
      utc.tm_sec, from, to, EncodedWords(fmt::format("Plumb {}: {}", message.unit, said)),
      message.id, from.substr(from.find('@') + 1));
  constexpr std::size_t kLine = 76;
  for (std::size_t i = 0; i < body.size(); i += kLine) mail += body.substr(i, kLine) + "\r\n";
  return mail;
}

std::string SyslogText(const OutMessage& message, const Catalogue& language) {
  return fmt::format("<{}>1 {:%Y-%m-%dT%H:%M:%SZ} {} plumbd {} {} - \xEF\xBB\xBF{}",
                     PriorityOf(message), UtcOf(message.time), message.unit, ::getpid(),
                     Name(message.kind), SaidTo(message, language));
}

std::string LocalSyslogText(const OutMessage& message, const Catalogue& language) {
  return fmt::format("<{}>plumbd[{}]: {}: {}", PriorityOf(message), ::getpid(), Name(message.kind),
                     SaidTo(message, language));
}

std::string WebhookBody(const OutMessage& message, const Catalogue& language) {
  return nlohmann::ordered_json{{"format", 1},
                                {"id", message.id},
                                {"time", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", UtcOf(message.time))},
                                {"unit", message.unit},
                                {"kind", Name(message.kind)},
                                {"repeated", message.is_repeated},
                                {"text", SaidTo(message, language)},
                                {"message", MessageJson(message.text)}}
      .dump();
}

std::string WebhookSignature(std::string_view body, std::string_view secret) {
  crypto_auth_hmacsha256_state state;
  crypto_auth_hmacsha256_init(&state, reinterpret_cast<const unsigned char*>(secret.data()),
                              secret.size());
  crypto_auth_hmacsha256_update(&state, reinterpret_cast<const unsigned char*>(body.data()),
                                body.size());
  std::array<unsigned char, crypto_auth_hmacsha256_BYTES> mac{};
  crypto_auth_hmacsha256_final(&state, mac.data());
  return fmt::format("sha256={:02x}", fmt::join(mac, ""));
}

}  // namespace plumb

// SPDX-License-Identifier: Apache-2.0
#include "daemon/config/messages_settings.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>

#include "algo/base/parse_number.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMostRecipients = 16, kLongestUrl = 1024, kLongestAddress = 254;

bool IsAtSign(char c) { return c == '@'; }

/// What goes into a header and a command of SMTP: plain characters, so that nothing can follow it.
bool IsMailAddress(const std::string& text) {
  return text.size() <= kLongestAddress && std::ranges::count_if(text, IsAtSign) == 1 &&
         text.front() != '@' && text.back() != '@' && std::ranges::all_of(text, [](char c) {
           return c > ' ' && c <= '~' &&
                  std::string_view("<>()[],;:\\\"").find(c) == std::string_view::npos;
         });
}

bool IsNumericAddress(const std::string& host) {
  std::array<unsigned char, 16> bytes{};
  return ::inet_pton(AF_INET, host.c_str(), bytes.data()) == 1 ||
         ::inet_pton(AF_INET6, host.c_str(), bytes.data()) == 1;
}

bool IsMailServer(const std::string& text) {
  const auto url = ParsePlainUrl(text);
  return url && (url->scheme == "smtp" || url->scheme == "smtps") && url->path.empty();
}

/// UDP takes a number, because nothing limits the time that the system takes to find a name.
bool IsSyslog(const std::string& text) {
  if (text == "local" || (text.starts_with("unix:///") && text.size() <= 107)) return true;
  const auto url = ParsePlainUrl(text);
  if (!url || url->port.empty() || !url->path.empty()) return false;
  return url->scheme == "tcp" || url->scheme == "tls" ||
         (url->scheme == "udp" && IsNumericAddress(url->host));
}

bool IsWebhook(const std::string& text) {
  const auto url = ParsePlainUrl(text);
  return url && (url->scheme == "https" || (url->scheme == "http" && !url->LeavesTheMachine()));
}

/// "09:00" to minutes after midnight.
std::optional<int> MinutesOf(std::string_view text) {
  if (text.size() != 5 || text[2] != ':') return std::nullopt;
  const auto hour = ParseNumber<int>(text.substr(0, 2)), minute = ParseNumber<int>(text.substr(3));
  if (!hour || !minute || *hour < 0 || *hour > 23 || *minute < 0 || *minute > 59)
    return std::nullopt;
  return 60 * *hour + *minute;
}

void CheckMailTogether(const MessagesSettings& settings) {
  if (settings.mail_to.empty()) return;
  if (settings.mail_from.empty()) throw DataError(say::config::MailNeedsSender());
  if (settings.mail_user.empty() != settings.mail_password_file.empty())
    throw DataError(say::config::MailUserAndPassword());
}

}  // namespace

bool PlainUrl::LeavesTheMachine() const {
  return host != "127.0.0.1" && host != "::1" && host != "localhost";
}

std::optional<PlainUrl> ParsePlainUrl(std::string_view text) {
  const bool is_plain = std::ranges::all_of(text, [](char c) { return c > ' ' && c <= '~'; });
  const std::size_t end_of_scheme = text.find("://");
  if (!is_plain || text.size() > kLongestUrl || end_of_scheme == std::string_view::npos)
    return std::nullopt;
  PlainUrl url{
      .scheme = std::string(text.substr(0, end_of_scheme)), .host = {}, .port = {}, .path = {}};
  text.remove_prefix(end_of_scheme + 3);
  const std::size_t end_of_place = std::min(text.find('/'), text.size());
  url.path = text.substr(end_of_place);
  std::string_view place = text.substr(0, end_of_place);
  if (place.find_first_of("@?#\\") != std::string_view::npos) return std::nullopt;
  if (place.starts_with('[')) {
    const std::size_t end = place.find(']');
    if (end == std::string_view::npos) return std::nullopt;
    url.host = place.substr(1, end - 1);
    place.remove_prefix(end + 1);
  } else {
    const std::size_t end = std::min(place.find(':'), place.size());
    url.host = place.substr(0, end);
    place.remove_prefix(end);
  }
  if (url.host.empty() || (!place.empty() && place.front() != ':')) return std::nullopt;
  if (!place.empty()) {
    url.port = place.substr(1);
    if (!ParseNumber<std::uint16_t>(url.port)) return std::nullopt;
  }
  return url;
}

MessagesSettings ReadMessagesSettings(Section section) {
  MessagesSettings settings;
  std::vector<std::string> languages;
  for (const Catalogue* one : Catalogues()) languages.push_back(fmt::format("\"{}\"", one->code));
  section.Take("language", settings.language, say::config::ExpectedOneOf(std::move(languages)),
               [](const std::string& code) { return FindCatalogue(code) != nullptr; });
  section.TakeNames("mail_to", settings.mail_to, say::config::ExpectedMailAddresses(),
                    kMostRecipients, IsMailAddress);
  section.Take("mail_from", settings.mail_from, say::config::ExpectedMailAddress(), IsMailAddress);
  section.Take("mail_server", settings.mail_server, say::config::ExpectedMailServer(),
               IsMailServer);
  section.Take("mail_user", settings.mail_user, say::config::ExpectedMailUser(),
               [](const std::string& s) { return !s.empty() && s.size() <= 255; });
  section.TakePath("mail_password_file", settings.mail_password_file);
  section.TakePath("sendmail", settings.sendmail);
  section.Take("syslog", settings.syslog, say::config::ExpectedSyslog(), IsSyslog);
  section.Take("webhook", settings.webhook, say::config::ExpectedWebhook(), IsWebhook);
  section.TakePath("webhook_secret_file", settings.webhook_secret_file);
  section.TakePath("trusted", settings.trusted);
  std::string due;
  section.Take("check_due", due, say::config::ExpectedTimeOfDay(),
               [](const std::string& text) { return MinutesOf(text).has_value(); });
  settings.check_due_min = MinutesOf(due).value_or(settings.check_due_min);
  section.TakeFlag("check_on_weekends", settings.check_on_weekends);
  section.RejectUnknownKeys();
  CheckMailTogether(settings);
  return settings;
}

}  // namespace plumb

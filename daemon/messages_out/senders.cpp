// SPDX-License-Identifier: Apache-2.0
#include "daemon/messages_out/senders.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <vector>

#include <fmt/format.h>

#include "algo/base/parse_number.hpp"
#include "daemon/network/transfer.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kMostSecretBytes = 4096;
constexpr std::chrono::seconds kLongestProgram{30}, kLongestWrite{10};
constexpr int kLookAgain_ms = 100;

const Catalogue& LanguageOf(const MessagesSettings& settings) {
  const Catalogue* const found = FindCatalogue(settings.language);
  return found != nullptr ? *found : EnglishCatalogue();
}

/// Without the line's end that editors add.
std::string SecretIn(const std::filesystem::path& file) {
  std::string secret = ReadTextFile(file, kMostSecretBytes);
  while (!secret.empty() && (secret.back() == '\n' || secret.back() == '\r')) secret.pop_back();
  return secret;
}

struct Unsent {
  std::string_view text;
};

std::size_t GiveMail(char* into, std::size_t size, std::size_t count, void* mail) {
  std::string_view& rest = static_cast<Unsent*>(mail)->text;
  const std::size_t given = std::min(size * count, rest.size());
  std::copy_n(rest.data(), given, into);
  rest.remove_prefix(given);
  return given;
}

/// An answer is read as far as it must be and then forgotten.
std::size_t ForgetAnswer(char*, std::size_t size, std::size_t count, void* bytes) {
  constexpr std::size_t kMostAnswer = 64 << 10;
  std::size_t& got = *static_cast<std::size_t*>(bytes);
  got += size * count;
  return got > kMostAnswer ? 0 : size * count;
}

std::string MailByServer(const std::string& mail, const MessagesSettings& settings,
                         const std::stop_token& stop) {
  Transfer transfer(settings.mail_server, "smtp,smtps", settings.trusted, stop);
  const auto url = ParsePlainUrl(settings.mail_server);
  // A server on this machine may have no certificate; nothing leaves the machine on the way to it.
  const bool is_here = url && !url->LeavesTheMachine();
  transfer.Set(CURLOPT_USE_SSL,
               is_here ? static_cast<long>(CURLUSESSL_TRY) : static_cast<long>(CURLUSESSL_ALL));
  const std::string password =
      settings.mail_user.empty() ? std::string() : SecretIn(settings.mail_password_file);
  if (!settings.mail_user.empty()) {
    transfer.Set(CURLOPT_USERNAME, settings.mail_user.c_str());
    transfer.Set(CURLOPT_PASSWORD, password.c_str());
  }
  transfer.Set(CURLOPT_MAIL_FROM, fmt::format("<{}>", settings.mail_from).c_str());
  for (const std::string& to : settings.mail_to) transfer.AddRecipient(fmt::format("<{}>", to));
  Unsent unsent{mail};
  transfer.Set(CURLOPT_READFUNCTION, &GiveMail);
  transfer.Set(CURLOPT_READDATA, static_cast<void*>(&unsent));
  transfer.Set(CURLOPT_UPLOAD, 1L);
  return transfer.Perform();
}

/// Waits for a child; kills it when it takes too long. @return its exit code; -1: a signal's.
int EndOf(pid_t child, const std::stop_token& stop) {
  const Descriptor handle(static_cast<int>(::syscall(SYS_pidfd_open, child, 0)));
  const auto latest = Clock::now() + kLongestProgram;
  pollfd ended{.fd = handle.get(), .events = POLLIN, .revents = 0};
  while (handle.get() >= 0 && ::poll(&ended, 1, kLookAgain_ms) <= 0 && !stop.stop_requested() &&
         Clock::now() < latest) {
  }
  if (ended.revents == 0) ::kill(child, SIGKILL);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::string MailByProgram(const std::string& mail, const MessagesSettings& settings,
                          const std::stop_token& stop) {
  const Descriptor text(::memfd_create("mail", MFD_CLOEXEC));
  if (text.get() < 0 ||
      ::write(text.get(), mail.data(), mail.size()) != static_cast<ssize_t>(mail.size()) ||
      ::lseek(text.get(), 0, SEEK_SET) != 0)
    return std::strerror(errno);
  std::vector<std::string> arguments = {"sendmail", "-i", "-f", settings.mail_from, "--"};
  arguments.insert(arguments.end(), settings.mail_to.begin(), settings.mail_to.end());
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  std::string path = "PATH=/usr/sbin:/usr/bin:/sbin:/bin";
  std::array<char*, 2> environment = {path.data(), nullptr};
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  ::posix_spawn_file_actions_init(&files);
  ::posix_spawnattr_init(&attributes);
  ::posix_spawn_file_actions_adddup2(&files, text.get(), STDIN_FILENO);
  ::posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  sigset_t none;  // the signals that the loop reads are blocked here
  ::sigemptyset(&none);
  ::posix_spawnattr_setsigmask(&attributes, &none);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  pid_t child = -1;
  const int error = ::posix_spawn(&child, settings.sendmail.c_str(), &files, &attributes,
                                  argv.data(), environment.data());
  ::posix_spawn_file_actions_destroy(&files);
  ::posix_spawnattr_destroy(&attributes);
  if (error != 0) return fmt::format("{}: {}", settings.sendmail.string(), std::strerror(error));
  const int code = EndOf(child, stop);
  return code == 0 ? "" : fmt::format("{}: exit code {}", settings.sendmail.string(), code);
}

std::string SendDatagram(const sockaddr* to, socklen_t length, const std::string& text) {
  const Descriptor socket(::socket(to->sa_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (socket.get() < 0 || ::connect(socket.get(), to, length) != 0 ||
      ::send(socket.get(), text.data(), text.size(), MSG_NOSIGNAL) < 0)
    return std::strerror(errno);
  return {};
}

std::string SendToSocket(const std::string& path, const std::string& text) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  return SendDatagram(reinterpret_cast<const sockaddr*>(&address), sizeof(address), text);
}

std::string SendUdp(const PlainUrl& url, const std::string& text) {
  const auto port = htons(ParseNumber<std::uint16_t>(url.port).value_or(0));
  sockaddr_in v4{};
  v4.sin_family = AF_INET;
  v4.sin_port = port;
  if (::inet_pton(AF_INET, url.host.c_str(), &v4.sin_addr) == 1)
    return SendDatagram(reinterpret_cast<const sockaddr*>(&v4), sizeof(v4), text);
  sockaddr_in6 v6{};
  v6.sin6_family = AF_INET6;
  v6.sin6_port = port;
  (void)::inet_pton(AF_INET6, url.host.c_str(), &v6.sin6_addr);
  return SendDatagram(reinterpret_cast<const sockaddr*>(&v6), sizeof(v6), text);
}

/// By the length before each message (RFC 5425 and 6587). The library only makes the connection,
/// with the same checks as for a page.
std::string SendStream(const PlainUrl& url, const std::string& text,
                       const MessagesSettings& settings, const std::stop_token& stop) {
  const bool is_tls = url.scheme == "tls";
  const std::string host =
      url.host.find(':') == std::string::npos ? url.host : "[" + url.host + "]";
  Transfer transfer(fmt::format("{}://{}:{}/", is_tls ? "https" : "http", host, url.port),
                    is_tls ? "https" : "http", settings.trusted, stop);
  transfer.Set(CURLOPT_CONNECT_ONLY, 1L);
  transfer.Set(CURLOPT_SSL_ENABLE_ALPN, 0L);
  if (std::string failed = transfer.Perform(); !failed.empty()) return failed;
  curl_socket_t socket = CURL_SOCKET_BAD;
  curl_easy_getinfo(transfer.handle(), CURLINFO_ACTIVESOCKET, &socket);
  const std::string framed = fmt::format("{} {}", text.size(), text);
  const auto latest = Clock::now() + kLongestWrite;
  for (std::size_t sent = 0; sent < framed.size();) {
    std::size_t now = 0;
    const CURLcode code =
        curl_easy_send(transfer.handle(), framed.data() + sent, framed.size() - sent, &now);
    if (code != CURLE_OK && code != CURLE_AGAIN) return curl_easy_strerror(code);
    sent += now;
    if (code == CURLE_OK) continue;
    pollfd ready{.fd = socket, .events = POLLOUT, .revents = 0};
    (void)::poll(&ready, 1, kLookAgain_ms);
    if (stop.stop_requested() || Clock::now() > latest)
      return curl_easy_strerror(CURLE_OPERATION_TIMEDOUT);
  }
  return {};
}

}  // namespace

std::string SendMail(const OutMessage& message, const MessagesSettings& settings,
                     const std::stop_token& stop) {
  std::string to;
  for (const std::string& one : settings.mail_to) to += (to.empty() ? "<" : ",\r\n <") + one + ">";
  const std::string mail = MailText(message, LanguageOf(settings), settings.mail_from, to);
  return settings.mail_server.empty() ? MailByProgram(mail, settings, stop)
                                      : MailByServer(mail, settings, stop);
}

std::string SendSyslog(const OutMessage& message, const MessagesSettings& settings,
                       const std::stop_token& stop) {
  constexpr std::string_view kUnix = "unix://";
  const Catalogue& language = LanguageOf(settings);
  if (settings.syslog == "local")
    return SendToSocket("/dev/log", LocalSyslogText(message, language));
  if (settings.syslog.starts_with(kUnix))
    return SendToSocket(settings.syslog.substr(kUnix.size()), LocalSyslogText(message, language));
  const PlainUrl url = ParsePlainUrl(settings.syslog).value_or(PlainUrl{});
  const std::string text = SyslogText(message, language);
  return url.scheme == "udp" ? SendUdp(url, text) : SendStream(url, text, settings, stop);
}

std::string SendWebhook(const OutMessage& message, const MessagesSettings& settings,
                        const std::stop_token& stop) {
  const std::string body = WebhookBody(message, LanguageOf(settings));
  Transfer transfer(settings.webhook, "https,http", settings.trusted, stop);
  transfer.AddHeader("Content-Type: application/json");
  transfer.AddHeader("User-Agent: plumbd");
  transfer.AddHeader("Expect:");  // one request, without asking first
  if (!settings.webhook_secret_file.empty())
    transfer.AddHeader("X-Plumb-Signature: " +
                       WebhookSignature(body, SecretIn(settings.webhook_secret_file)));
  std::size_t answered = 0;
  transfer.Set(CURLOPT_POSTFIELDSIZE, static_cast<long>(body.size()));
  transfer.Set(CURLOPT_POSTFIELDS, body.c_str());
  transfer.Set(CURLOPT_WRITEFUNCTION, &ForgetAnswer);
  transfer.Set(CURLOPT_WRITEDATA, static_cast<void*>(&answered));
  const std::string failed = transfer.Perform();
  // The status decides, whatever becomes of the rest of the answer.
  const long status = transfer.status();
  if (status >= 200 && status < 300) return "";
  return status > 0 ? fmt::format("HTTP {}", status) : failed;
}

}  // namespace plumb

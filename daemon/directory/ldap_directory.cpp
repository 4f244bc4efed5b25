// SPDX-License-Identifier: Apache-2.0
#include "daemon/directory/ldap_directory.hpp"

#include <fcntl.h>
#include <ldap.h>
#include <netdb.h>
#include <openldap.h>
#include <poll.h>
#include <resolv.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <functional>
#include <memory>
#include <stop_token>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/plain_text.hpp"
#include "daemon/loop/end_guard.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/unix_socket.hpp"
#include "words/directory.hpp"

namespace plumb {
namespace {

constexpr timeval kLongest = {.tv_sec = 5, .tv_usec = 0};  // Of one step.
constexpr std::chrono::seconds kLongestInAll{10};
constexpr int kMostEntries = 500;              // Of one search.
constexpr ber_len_t kMostBytes = 1024 * 1024;  // Of one message of the server.
constexpr int kMostAddresses = 3;              // Of one name.

// Ends a question that takes too long, or whose asker goes, by shutting its connection down. The
// library has no limit for a TLS handshake in which the server says nothing: with its own for the
// network it asks the socket again and again, which takes a whole processor, and without one it
// waits for ever.
class Interrupt {
 public:
  // The descriptor stays open until this object is gone.
  Interrupt(int fd, std::chrono::steady_clock::time_point end, const std::stop_token& stop)
      : too_long_(std::chrono::duration_cast<std::chrono::milliseconds>(
                      end - std::chrono::steady_clock::now()),
                  [fd] { ::shutdown(fd, SHUT_RDWR); }),
        stopped_(stop, [fd] { ::shutdown(fd, SHUT_RDWR); }) {}

 private:
  EndGuard too_long_;
  std::stop_callback<std::function<void()>> stopped_;
};

struct Unbind {
  void operator()(LDAP* connection) const { ldap_unbind_ext_s(connection, nullptr, nullptr); }
};
using Connection = std::unique_ptr<LDAP, Unbind>;

// Why there is no answer.
struct Unanswered {
  Message why;
};

bool IsAway(int code) {
  return code == LDAP_SERVER_DOWN || code == LDAP_TIMEOUT || code == LDAP_CONNECT_ERROR ||
         code == LDAP_BUSY || code == LDAP_UNAVAILABLE;
}

// @param connection  Knows more about a certificate that is refused; may be null.
// @throws Unanswered  That the server is away, or what is wrong with the question: then the
//                     configuration is.
void Check(LDAP* connection, int code) {
  if (code == LDAP_SUCCESS) return;
  std::string why = ldap_err2string(code);
  char* given = nullptr;
  if (connection != nullptr &&
      ldap_get_option(connection, LDAP_OPT_DIAGNOSTIC_MESSAGE, &given) == LDAP_OPT_SUCCESS &&
      given != nullptr) {
    const std::unique_ptr<char, decltype(&ldap_memfree)> held(given, ldap_memfree);
    if (*given != '\0') why += fmt::format(" ({})", AsPlainText(given));
  }
  throw Unanswered{IsAway(code) ? say::directory::NoAnswer(why)
                                : say::directory::CannotBeAsked(why)};
}

// Waits kLongest for an address to answer. @return no descriptor if it does not.
Descriptor Dialled(const addrinfo& address, std::chrono::steady_clock::time_point end,
                   const std::stop_token& stop) {
  Descriptor socket(::socket(address.ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int fd = socket.get();
  const Interrupt interrupt(fd, end, stop);
  if (::connect(fd, address.ai_addr, address.ai_addrlen) != 0) {
    pollfd waiting{.fd = fd, .events = POLLOUT, .revents = 0};
    int error = 0;
    socklen_t length = sizeof error;
    if (errno != EINPROGRESS || ::poll(&waiting, 1, kLongest.tv_sec * 1000) != 1 ||
        ::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &length) != 0 || error != 0)
      return Descriptor(-1);
  }
  if (::fcntl(fd, F_SETFL, 0) != 0) return Descriptor(-1);
  return socket;
}

// A connection to the server, before anything is said. The library's own would wait for minutes
// where no server answers.
Descriptor Dial(const std::string& url, std::chrono::steady_clock::time_point end,
                const std::stop_token& stop) {
  LDAPURLDesc* given = nullptr;
  if (ldap_url_parse(url.c_str(), &given) != LDAP_URL_SUCCESS) Check(nullptr, LDAP_PARAM_ERROR);
  const std::unique_ptr<LDAPURLDesc, decltype(&ldap_free_urldesc)> parts(given, ldap_free_urldesc);
  const std::string host = parts->lud_host == nullptr ? "" : parts->lud_host;
  if (url.starts_with("ldapi://")) {
    try {
      return Descriptor(ConnectUnix(host));
    } catch (const DeviceError& error) {
      throw Unanswered{say::directory::NoAnswer(error.what())};
    }
  }
  // Of this thread only: the usual ones are 5 s, tried twice.
  if (::res_init() == 0) {
    _res.retrans = 2;
    _res.retry = 1;
  }
  addrinfo wanted{}, *found = nullptr;
  wanted.ai_socktype = SOCK_STREAM;
  const int code =
      ::getaddrinfo(host.c_str(), fmt::format("{}", parts->lud_port).c_str(), &wanted, &found);
  if (code != 0)
    throw Unanswered{say::directory::NoAnswer(fmt::format("{}: {}", host, ::gai_strerror(code)))};
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> held(found, ::freeaddrinfo);
  int tried = 0;
  for (const addrinfo* one = found; one != nullptr && tried < kMostAddresses;
       one = one->ai_next, ++tried)
    if (Descriptor socket = Dialled(*one, end, stop); socket.get() >= 0) return socket;
  throw Unanswered{say::directory::NoAnswer(ldap_err2string(LDAP_SERVER_DOWN))};
}

std::string Replaced(std::string text, std::string_view place, const std::string& by) {
  for (std::size_t at = text.find(place); at != std::string::npos;
       at = text.find(place, at + by.size()))
    text.replace(at, place.size(), by);
  return text;
}

std::string Escaped(std::string_view text, std::string_view special, const char* format) {
  std::string escaped;
  for (const char c : text) {
    if (special.find(c) == std::string_view::npos && c != '\0')
      escaped += c;
    else
      escaped += fmt::format(fmt::runtime(format), static_cast<unsigned char>(c));
  }
  return escaped;
}

// Within a distinguished name (RFC 4514) and within a filter (RFC 4515). Names of accounts have
// neither blanks nor '#' at their ends.
std::string InName(const std::string& text) { return Escaped(text, "\"+,;<>\\=/", "\\{:02x}"); }
std::string InFilter(const std::string& text) { return Escaped(text, "*()\\", "\\{:02x}"); }

// Different spellings of one distinguished name give the same text.
std::string Normalised(const std::string& name) {
  char* given = nullptr;
  if (ldap_dn_normalize(name.c_str(), LDAP_DN_FORMAT_LDAPV3, &given,
                        LDAP_DN_FORMAT_LDAPV3 | LDAP_DN_PEDANTIC) != LDAP_SUCCESS ||
      given == nullptr)
    return name;
  const std::unique_ptr<char, decltype(&ldap_memfree)> held(given, ldap_memfree);
  std::string normalised = given;
  std::ranges::transform(normalised, normalised.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return normalised;
}

// @param fd  Connected; it belongs to this connection from now on.
Connection Connect(const DirectorySettings& settings, int fd) {
  LDAP* made = nullptr;
  const bool is_local = settings.url.starts_with("ldapi://");
  const int code =
      ldap_init_fd(fd, is_local ? LDAP_PROTO_IPC : LDAP_PROTO_TCP, settings.url.c_str(), &made);
  if (code != LDAP_SUCCESS) ::close(fd);
  Check(nullptr, code);
  Connection connection(made);
  const auto set = [&](int option, const void* value) {
    if (ldap_set_option(made, option, value) != LDAP_OPT_SUCCESS) Check(nullptr, LDAP_PARAM_ERROR);
  };
  const int version = LDAP_VERSION3, demand = LDAP_OPT_X_TLS_DEMAND, client = 0,
            least = LDAP_OPT_X_TLS_PROTOCOL_TLS1_2;
  set(LDAP_OPT_PROTOCOL_VERSION, &version);
  set(LDAP_OPT_REFERRALS, LDAP_OPT_OFF);  // The password goes to this server only.
  set(LDAP_OPT_TIMEOUT, &kLongest);
  // Whoever answers in the place of the server must not fill the memory, TLS or not.
  Sockbuf* buffer = nullptr;
  ber_len_t most = kMostBytes;
  if (ldap_get_option(made, LDAP_OPT_SOCKBUF, &buffer) != LDAP_OPT_SUCCESS ||
      ber_sockbuf_ctrl(buffer, LBER_SB_OPT_SET_MAX_INCOMING, &most) < 0)
    Check(nullptr, LDAP_LOCAL_ERROR);
  if (is_local) return connection;
  set(LDAP_OPT_X_TLS_REQUIRE_CERT, &demand);
  set(LDAP_OPT_X_TLS_PROTOCOL_MIN, &least);
  const std::string trusted =
      settings.trusted.empty() ? "/etc/ssl/certs/ca-certificates.crt" : settings.trusted.string();
  if (::access(trusted.c_str(), R_OK) != 0) throw Unanswered{say::directory::NoAuthority(trusted)};
  set(LDAP_OPT_X_TLS_CACERTFILE, trusted.c_str());
  set(LDAP_OPT_X_TLS_NEWCTX, &client);
  Check(made, settings.url.starts_with("ldap://") ? ldap_start_tls_s(made, nullptr, nullptr)
                                                  : ldap_install_tls(made));
  return connection;
}

// False: name and password do not belong together.
bool LogsIn(LDAP* connection, const std::string& person, const std::string& password) {
  berval secret{};
  secret.bv_len = password.size();
  secret.bv_val = const_cast<char*>(password.data());  // NOLINT: the library only reads it
  const int code = ldap_sasl_bind_s(connection, person.c_str(), LDAP_SASL_SIMPLE, &secret, nullptr,
                                    nullptr, nullptr);
  if (code == LDAP_INVALID_CREDENTIALS || code == LDAP_NO_SUCH_OBJECT ||
      code == LDAP_INAPPROPRIATE_AUTH)
    return false;
  Check(connection, code);
  return true;
}

using Answer = std::unique_ptr<LDAPMessage, decltype(&ldap_msgfree)>;

// Names of the entries that a filter finds, taken one by one: the limit that the server is asked to
// keep is no promise of its own.
std::vector<std::string> Find(LDAP* connection, const std::string& base,
                              const std::string& filter) {
  std::string no_attributes = LDAP_NO_ATTRS;
  std::array<char*, 2> attributes = {no_attributes.data(), nullptr};
  timeval longest = kLongest;
  int id = 0;
  Check(connection, ldap_search_ext(connection, base.c_str(), LDAP_SCOPE_SUBTREE, filter.c_str(),
                                    attributes.data(), /*attrsonly=*/1, nullptr, nullptr, &longest,
                                    kMostEntries, &id));
  std::vector<std::string> names;
  for (;;) {
    LDAPMessage* given = nullptr;
    const int kind = ldap_result(connection, id, LDAP_MSG_ONE, &longest, &given);
    const Answer message(given, ldap_msgfree);
    if (kind == LDAP_RES_SEARCH_RESULT) {
      int code = LDAP_SUCCESS;
      Check(connection, ldap_parse_result(connection, given, &code, nullptr, nullptr, nullptr,
                                          nullptr, /*freeit=*/0));
      Check(connection, code);
      return names;
    }
    if (kind == 0) Check(connection, LDAP_TIMEOUT);
    if (kind < 0) Check(connection, LDAP_SERVER_DOWN);
    if (kind != LDAP_RES_SEARCH_ENTRY) continue;  // a referral
    if (names.size() == static_cast<std::size_t>(kMostEntries)) {
      ldap_abandon_ext(connection, id, nullptr, nullptr);
      Check(nullptr, LDAP_SIZELIMIT_EXCEEDED);
    }
    const std::unique_ptr<char, decltype(&ldap_memfree)> name(ldap_get_dn(connection, given),
                                                              ldap_memfree);
    if (name) names.emplace_back(name.get());
  }
}

// The role of the first list, in this order, that has one of the groups.
std::optional<Role> RoleOf(const DirectorySettings& settings, std::vector<std::string> groups) {
  for (std::string& group : groups) group = Normalised(group);
  for (const auto& [role, names] : {std::pair(Role::kEngineer, &settings.engineers),
                                    std::pair(Role::kPhysicist, &settings.physicists),
                                    std::pair(Role::kTechnician, &settings.technicians)})
    for (const std::string& name : *names)
      if (std::ranges::find(groups, Normalised(name)) != groups.end()) return role;
  return std::nullopt;
}

}  // namespace

web::DirectoryAnswer AskLdap(const DirectorySettings& settings, const std::string& name,
                             const std::string& password, const std::stop_token& stop) {
  web::DirectoryAnswer answer;
  if (name.empty() || password.empty()) return answer;
  const auto end = std::chrono::steady_clock::now() + kLongestInAll;
  try {
    if (stop.stop_requested()) throw Unanswered{say::directory::NoAnswer("stop")};
    // It stays open until the end, so that no other one is ever shut down in its place.
    const Descriptor socket = Dial(settings.url, end, stop);
    const Interrupt interrupt(socket.get(), end, stop);
    const Connection connection = Connect(settings, ::dup(socket.get()));
    std::string person = Replaced(settings.person, "{name}", InName(name));
    if (!LogsIn(connection.get(), person, password)) return answer;
    if (!settings.people_filter.empty()) {
      const std::vector<std::string> found =
          Find(connection.get(), settings.people_base,
               Replaced(settings.people_filter, "{name}", InFilter(name)));
      // Two entries of that name: whose groups count is not known.
      if (found.size() != 1) throw Unanswered{say::directory::PersonNotFound(found.size())};
      person = found.front();
    }
    const std::string groups = Replaced(
        Replaced(settings.groups_filter, "{person}", InFilter(person)), "{name}", InFilter(name));
    answer.role = RoleOf(settings, Find(connection.get(), settings.groups_base, groups));
    answer.matches = true;  // last: a failure is no answer
  } catch (const Unanswered& unanswered) {
    answer.failure = unanswered.why;
  } catch (const std::exception& error) {  // no memory, or no thread
    answer.failure = say::directory::NoAnswer(error.what());
  }
  return answer;
}

}  // namespace plumb

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
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <functional>
#include <memory>
#include <stop_token>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "algo/base/ascii_lower.hpp"
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
      : fd_(fd),
        too_long_(std::chrono::duration_cast<std::chrono::milliseconds>(
                      end - std::chrono::steady_clock::now()),
                  [this] { Act(); }),
        stopped_(stop, [this] { Act(); }) {}

  [[nodiscard]] bool has_acted() const { return has_acted_; }

 private:
  void Act() {
    has_acted_ = true;
    ::shutdown(fd_, SHUT_RDWR);
  }

  const int fd_;
  std::atomic<bool> has_acted_ = false;
  EndGuard too_long_;  // this and the next one last: they use the others
  std::stop_callback<std::function<void()>> stopped_;
};

struct Unbind {
  void operator()(LDAP* connection) const { ldap_unbind_ext_s(connection, nullptr, nullptr); }
};
using Connection = std::unique_ptr<LDAP, Unbind>;

// Why the question has no answer.
struct Failure {
  Message why;
};

bool IsAway(int code) {
  return code == LDAP_SERVER_DOWN || code == LDAP_TIMEOUT || code == LDAP_CONNECT_ERROR ||
         code == LDAP_BUSY || code == LDAP_UNAVAILABLE || code == LDAP_USER_CANCELLED;
}

// Neither the server's absence nor a wrong configuration.
bool IsTrouble(int code) {
  return code == LDAP_TIMELIMIT_EXCEEDED || code == LDAP_ADMINLIMIT_EXCEEDED ||
         code == LDAP_OTHER || code == LDAP_NO_MEMORY || code == LDAP_LOCAL_ERROR;
}

// @param connection  Has what the server said beside the code; may be null.
std::string WhyOf(LDAP* connection, int code) {
  std::string why = ldap_err2string(code);
  char* given = nullptr;
  if (connection != nullptr &&
      ldap_get_option(connection, LDAP_OPT_DIAGNOSTIC_MESSAGE, &given) == LDAP_OPT_SUCCESS &&
      given != nullptr) {
    const std::unique_ptr<char, decltype(&ldap_memfree)> held(given, ldap_memfree);
    // Of a certificate that it refuses the library says "(unknown error code)".
    if (*given != '\0' && *given != '(') why += fmt::format(" ({})", AsPlainText(given));
  }
  return why;
}

// @param connection  As above.
// @throws Failure  That the server is away, or what is wrong with the question: then the
//                  configuration is.
void Check(LDAP* connection, int code) {
  if (code == LDAP_SUCCESS) return;
  const std::string why = WhyOf(connection, code);
  if (IsAway(code)) throw Failure{say::directory::NoAnswer(why)};
  if (IsTrouble(code)) throw Failure{say::directory::QuestionFailed(why)};
  throw Failure{say::directory::CannotBeAsked(why)};
}

// Waits kLongest for an address to answer. A full queue of a Unix socket is not waited for.
// @return 0 with `socket` connected, or why it is not, as errno.
int Connect(int socket, const sockaddr* address, socklen_t size,
            std::chrono::steady_clock::time_point end, const std::stop_token& stop) {
  const Interrupt interrupt(socket, end, stop);
  int error = ::connect(socket, address, size) == 0 ? 0 : errno;
  if (error == EINPROGRESS) {
    pollfd waiting{.fd = socket, .events = POLLOUT, .revents = 0};
    socklen_t length = sizeof error;
    const int ready = ::poll(&waiting, 1, kLongest.tv_sec * 1000);
    if (ready == 0) return ETIMEDOUT;
    if (ready < 0 || ::getsockopt(socket, SOL_SOCKET, SO_ERROR, &error, &length) != 0) return errno;
  }
  if (error != 0) return error;
  return ::fcntl(socket, F_SETFL, 0) == 0 ? 0 : errno;
}

Descriptor NewSocket(int family) {
  return Descriptor(::socket(family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
}

Failure NotReached(const std::string& where, int error) {
  return {say::directory::NoAnswer(fmt::format("{}: {}", where, std::strerror(error)))};
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
    Descriptor socket = NewSocket(AF_UNIX);
    int error = socket.get() < 0 ? errno : 0;
    const auto connect = [&](const sockaddr* address, socklen_t size) {
      errno = Connect(socket.get(), address, size, end, stop);
      return errno == 0 ? 0 : -1;
    };
    if (error == 0 && WithUnixAddress(host, connect) != 0) error = errno;
    if (error != 0) throw NotReached(host, error);
    return socket;
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
    throw Failure{say::directory::NoAnswer(fmt::format("{}: {}", host, ::gai_strerror(code)))};
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> held(found, ::freeaddrinfo);
  int tried = 0, error = 0;
  for (const addrinfo* one = found; one != nullptr && tried < kMostAddresses;
       one = one->ai_next, ++tried) {
    Descriptor socket = NewSocket(one->ai_family);
    error =
        socket.get() < 0 ? errno : Connect(socket.get(), one->ai_addr, one->ai_addrlen, end, stop);
    if (error == 0) return socket;
  }
  throw NotReached(host, error);
}

// What stands in the text for others; what is put in their places is looked through for none.
using Places = std::vector<std::pair<std::string_view, std::string>>;

std::string Filled(std::string_view text, const Places& places) {
  std::string filled;
  while (!text.empty()) {
    const auto place = std::ranges::find_if(
        places, [&](const auto& known) { return text.starts_with(known.first); });
    filled += place == places.end() ? std::string(1, text.front()) : place->second;
    text.remove_prefix(place == places.end() ? 1 : place->first.size());
  }
  return filled;
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
  return AsciiLower(given);
}

// With a certificate that is checked: nothing is said without.
void BeginTls(LDAP* connection, const DirectorySettings& settings, const Interrupt& interrupt) {
  const auto set = [&](int option, const void* value) {
    if (ldap_set_option(connection, option, value) != LDAP_OPT_SUCCESS)
      Check(nullptr, LDAP_PARAM_ERROR);
  };
  const int demand = LDAP_OPT_X_TLS_DEMAND, client = 0, least = LDAP_OPT_X_TLS_PROTOCOL_TLS1_2;
  set(LDAP_OPT_X_TLS_REQUIRE_CERT, &demand);
  set(LDAP_OPT_X_TLS_PROTOCOL_MIN, &least);
  const std::string trusted =
      settings.trusted.empty() ? "/etc/ssl/certs/ca-certificates.crt" : settings.trusted.string();
  if (::access(trusted.c_str(), R_OK) != 0) throw Failure{say::directory::NoAuthority(trusted)};
  set(LDAP_OPT_X_TLS_CACERTFILE, trusted.c_str());
  set(LDAP_OPT_X_TLS_NEWCTX, &client);
  const int code = settings.url.starts_with("ldap://")
                       ? ldap_start_tls_s(connection, nullptr, nullptr)
                       : ldap_install_tls(connection);
  // The library's code for each handshake that fails, also for one that was cut short.
  if (code == LDAP_CONNECT_ERROR && !interrupt.has_acted())
    throw Failure{say::directory::NotTrusted(WhyOf(connection, code), trusted)};
  Check(connection, code);
}

// @param fd  Connected; it belongs to this connection from now on.
Connection Open(const DirectorySettings& settings, int fd, const Interrupt& interrupt) {
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
  const int version = LDAP_VERSION3;
  set(LDAP_OPT_PROTOCOL_VERSION, &version);
  set(LDAP_OPT_REFERRALS, LDAP_OPT_OFF);  // The password goes to this server only.
  set(LDAP_OPT_TIMEOUT, &kLongest);
  // Whoever answers in the place of the server must not fill the memory, TLS or not.
  Sockbuf* buffer = nullptr;
  ber_len_t most = kMostBytes;
  if (ldap_get_option(made, LDAP_OPT_SOCKBUF, &buffer) != LDAP_OPT_SUCCESS ||
      ber_sockbuf_ctrl(buffer, LBER_SB_OPT_SET_MAX_INCOMING, &most) < 0)
    Check(nullptr, LDAP_LOCAL_ERROR);
  if (!is_local) BeginTls(made, settings, interrupt);
  return connection;
}

// Such as a locked account or a password that has run out; some servers say so whatever the
// password is.
bool IsRefusal(int code) {
  return code == LDAP_CONSTRAINT_VIOLATION || code == LDAP_UNWILLING_TO_PERFORM;
}

// False: name and password do not belong together, or `refusal` says why the person may not log in.
bool LogsIn(LDAP* connection, const std::string& person, const std::string& password,
            Message& refusal) {
  berval secret{};
  secret.bv_len = password.size();
  secret.bv_val = const_cast<char*>(password.data());  // NOLINT: the library only reads it
  const int code = ldap_sasl_bind_s(connection, person.c_str(), LDAP_SASL_SIMPLE, &secret, nullptr,
                                    nullptr, nullptr);
  if (code == LDAP_INVALID_CREDENTIALS || code == LDAP_NO_SUCH_OBJECT ||
      code == LDAP_INAPPROPRIATE_AUTH)
    return false;
  if (IsRefusal(code)) {
    refusal = say::directory::RefusesPerson(WhyOf(connection, code));
    return false;
  }
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
    if (stop.stop_requested()) Check(nullptr, LDAP_USER_CANCELLED);
    // It stays open until the end, so that no other one is ever shut down in its place.
    const Descriptor socket = Dial(settings.url, end, stop);
    const Interrupt interrupt(socket.get(), end, stop);
    const Connection connection = Open(settings, ::dup(socket.get()), interrupt);
    std::string person = Filled(settings.person, {{kPlaceOfName, InName(name)}});
    if (!LogsIn(connection.get(), person, password, answer.refusal)) return answer;
    if (!settings.people_filter.empty()) {
      const std::vector<std::string> found =
          Find(connection.get(), settings.people_base,
               Filled(settings.people_filter, {{kPlaceOfName, InFilter(name)}}));
      // Two entries of that name: whose groups count is not known.
      if (found.size() != 1) throw Failure{say::directory::PersonNotFound(found.size())};
      person = found.front();
    }
    const std::string groups = Filled(settings.groups_filter, {{kPlaceOfPerson, InFilter(person)},
                                                               {kPlaceOfName, InFilter(name)}});
    answer.role = RoleOf(settings, Find(connection.get(), settings.groups_base, groups));
    answer.matches = true;  // last: a failure is no answer
  } catch (const Failure& failure) {
    answer.failure = failure.why;
  } catch (const std::exception& error) {  // no memory, or no thread
    answer.failure = say::directory::QuestionFailed(error.what());
  }
  return answer;
}

}  // namespace plumb

// SPDX-License-Identifier: Apache-2.0
#include "web/http/transport.hpp"

#include <arpa/inet.h>
#include <microhttpd.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>

#include "algo/base/ascii_lower.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/plain_text.hpp"
#include "web/http/checks.hpp"
#include "web/http/exchange.hpp"
#include "web/http/listen_socket.hpp"
#include "web/http/served_certificate.hpp"
#include "web/model/kept_free.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxPath = 256;
constexpr std::size_t kMaxQueryFields = 8;
constexpr std::size_t kMaxHeaders = 64;
constexpr std::size_t kStreamBlock = 4096;
/// Of a file, one piece is sent in each run of the library. Each answer with a file has room for
/// one.
constexpr std::size_t kFileBlock = 128 << 10;
/// Over TLS a run of the library sends no more than 16 KiB, and the loop's timer takes 1 ms to the
/// next turn: so there are runs for this long.
constexpr std::chrono::microseconds kRunsATurn{200};

std::string AddressOf(MHD_Connection* connection) {
  const auto* info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (info == nullptr || info->client_addr == nullptr) return {};
  if (info->client_addr->sa_family == AF_INET) {
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(info->client_addr)->sin_addr,
              text.data(), text.size());
  } else if (info->client_addr->sa_family == AF_INET6) {
    const in6_addr& v6 = reinterpret_cast<const sockaddr_in6*>(info->client_addr)->sin6_addr;
    // On a socket for both families, IPv4 addresses are mapped ones: the log and the counters get
    // the plain address.
    if (IN6_IS_ADDR_V4MAPPED(&v6)) {
      inet_ntop(AF_INET, &v6.s6_addr[12], text.data(), text.size());
    } else {
      inet_ntop(AF_INET6, &v6, text.data(), text.size());
    }
  }
  return text.data();
}

void CutSocket(MHD_Connection* connection) {
  const auto* info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  if (info == nullptr) return;
  // Data waiting in the kernel for a reader that never reads is dropped with the connection.
  const linger drop{1, 0};
  setsockopt(info->connect_fd, SOL_SOCKET, SO_LINGER, &drop, sizeof drop);
  shutdown(info->connect_fd, SHUT_RDWR);
}

/// The server whose library runs on this thread, because the library asks for the certificate of a
/// handshake without stating the server.
thread_local Transport* serving = nullptr;

}  // namespace

struct Transport::Callbacks {
  static int OnHandshake(gnutls_session_t, const gnutls_datum_t*, int, const gnutls_pk_algorithm_t*,
                         int, gnutls_pcert_st** chain, unsigned* length, gnutls_privkey_t* key) {
    if (serving == nullptr || serving->certificates_.empty()) return -1;
    ServedCertificate& certificate = *serving->certificates_.back();
    *chain = certificate.chain();
    *length = certificate.length();
    *key = certificate.key();
    return 0;
  }

  static std::size_t KeepEscapes(void*, MHD_Connection*, char* text) { return std::strlen(text); }

  static void OnConnection(void* self, MHD_Connection* connection, void** context,
                           MHD_ConnectionNotificationCode code) {
    auto* transport = static_cast<Transport*>(self);
    if (code == MHD_CONNECTION_NOTIFY_STARTED) {
      const auto* info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
      const auto now = transport->options_.now();
      *context =
          transport->connections_.Add(info->connect_fd, NetworkOf(AddressOf(connection)), now);
      while (const Connection* leaving = transport->connections_.NextOverLimit(now))
        shutdown(leaving->fd, SHUT_RDWR);
    } else {
      transport->connections_.Remove(static_cast<Connection*>(*context));
      *context = nullptr;
    }
  }

  static Connection* ConnectionOf(MHD_Connection* connection) {
    const auto* info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    return info != nullptr ? static_cast<Connection*>(info->socket_context) : nullptr;
  }

  static void OnCompleted(void* self, MHD_Connection* connection, void** context,
                          MHD_RequestTerminationCode) {
    auto* transport = static_cast<Transport*>(self);
    const ScopedLoopLabel label(transport->options_, "the end of a request");
    if (Connection* known = ConnectionOf(connection)) {
      known->since = transport->options_.now();
      known->receiving = true;
      known->has_head = false;
      known->uploading = false;
    }
    auto* held = static_cast<std::shared_ptr<Exchange>*>(*context);
    if (held == nullptr) return;
    transport->exchanges_.remove(held->get());
    if ((*held)->stream) {
      (*held)->stream->wake = nullptr;
      (*held)->stream->cut = nullptr;
      transport->hub_.Remove((*held)->stream);
    }
    (*held)->response.emplace();  // late responses are dropped
    delete held;
    *context = nullptr;
  }

  static MHD_Result OnHeader(void* cls, MHD_ValueKind, const char* key, const char* value) {
    auto* exchange = static_cast<Exchange*>(cls);
    if (!IsToken(key) || !exchange->head.TakeHeader(key, value)) exchange->malformed = true;
    std::string name = AsciiLower(key);
    const std::string_view text = value != nullptr ? value : "";
    exchange->num_hosts += name == "host" ? 1 : 0;
    auto& headers = exchange->request.headers;
    if (!IsPlainText(text) || headers.size() >= kMaxHeaders) exchange->malformed = true;
    const auto [where, fresh] = headers.emplace(std::move(name), text);
    if (!fresh && where->first == "cookie") where->second.append("; ").append(text);
    if (!fresh && (where->first == "content-length" || where->first == "x-csrf-token" ||
                   where->first == "origin" || where->first == "transfer-encoding"))
      exchange->malformed = true;
    return MHD_YES;
  }

  static MHD_Result OnQuery(void* cls, MHD_ValueKind, const char* key, const char* value) {
    auto* exchange = static_cast<Exchange*>(cls);
    const std::string_view text = value != nullptr ? value : "";
    auto& query = exchange->request.query;
    const bool valid =
        IsName(key) && (text.empty() || IsName(text)) && query.size() < kMaxQueryFields;
    if (!valid || !query.emplace(key, text).second) exchange->malformed = true;
    exchange->head.TakeQuery(key, value);
    return MHD_YES;
  }

  static std::optional<Response> RefuseByHead(Transport& transport, Exchange& exchange,
                                              std::size_t max_body) {
    const Request& request = exchange.request;
    if (exchange.malformed || exchange.num_hosts != 1 || request.path.size() > kMaxPath)
      return ErrorResponse(400, say::web::Malformed());
    const std::string_view length = request.Header("content-length");
    if (const auto coding = request.headers.find("transfer-encoding");
        coding != request.headers.end()) {
      if (request.headers.contains("content-length"))
        return ErrorResponse(400, say::web::LengthTwice());
      // The library ignores other codings, and would read the body as the next request.
      if (!IsChunked(coding->second)) return ErrorResponse(400, say::web::CodingUnknown());
    }
    std::uint64_t bytes = 0;
    if (!length.empty()) {
      const char* const end = length.data() + length.size();
      const auto [stop, error] = std::from_chars(length.data(), end, bytes);
      if (error == std::errc::result_out_of_range)
        return ErrorResponse(413, say::web::BodyTooLong());
      if (error != std::errc() || stop != end) return ErrorResponse(400, say::web::Malformed());
    }
    auto admitted = transport.gate_.Admit(exchange.request);
    if (Connection* known = ConnectionOf(exchange.connection))
      known->user = request.session ? request.session->user : std::string();
    if (auto* refusal = std::get_if<Response>(&admitted)) return std::move(*refusal);
    exchange.route = std::get<const Route*>(admitted);
    if (exchange.route->body == BodyKind::kFile) return BeginUpload(transport, exchange, bytes);
    if (bytes > max_body)
      return ErrorResponse(413, say::web::BodyLongerThan(static_cast<double>(max_body)));
    return std::nullopt;
  }

  static std::optional<Response> BeginUpload(Transport& transport, Exchange& exchange,
                                             std::uint64_t bytes) {
    const HttpServerOptions& options = transport.options_;
    if (options.upload_folder.empty()) return ErrorResponse(409, say::web::NoUploads());
    if (!transport.upload_.expired())
      return ErrorResponse(
          409, transport.has_whole_upload_ ? say::web::UploadInUse() : say::web::AnotherUpload());
    if (bytes == 0) return ErrorResponse(411, say::web::UploadLength());
    const std::uint64_t most = exchange.route->most_bytes > 0
                                   ? std::min(exchange.route->most_bytes, options.max_upload_bytes)
                                   : options.max_upload_bytes;
    if (bytes > most)
      return ErrorResponse(413, say::web::FileTooLarge(static_cast<double>(most >> 20)));
    try {
      // Removing it takes time in proportion to its size.
      exchange.request.upload = std::shared_ptr<UploadFile>(
          new UploadFile(options.upload_folder),
          [&background = transport.background_](UploadFile* file) {
            if (!background.RunInBackground(
                    BackgroundPool::kFiles, [file] { delete file; }, [] {}))
              delete file;
          });
    } catch (const IoError& error) {
      return ErrorResponse(507, error.message());
    }
    std::error_code error;
    const auto space = std::filesystem::space(options.upload_folder, error);
    if (!error && space.available < bytes + kKeptFree) {
      exchange.request.upload.reset();
      const auto whole_mb = [](std::uint64_t size) { return static_cast<double>(size >> 20); };
      return ErrorResponse(507,
                           say::web::DiskTooFull(whole_mb(space.available), whole_mb(kKeptFree)));
    }
    transport.upload_ = exchange.request.upload;
    transport.has_whole_upload_ = false;
    if (Connection* known = ConnectionOf(exchange.connection)) known->uploading = true;
    return std::nullopt;
  }

  static MHD_Result Begin(Transport& transport, MHD_Connection* connection, const char* url,
                          const char* method, const char* version, void** context) {
    auto exchange = std::make_shared<Exchange>(
        transport.options_, transport.background_, [&transport] { transport.Wake(); }, connection);
    exchange->head_only = std::strcmp(method, "HEAD") == 0;
    exchange->request.method = exchange->head_only ? "GET" : method;
    exchange->request.path = url;
    exchange->request.address = AddressOf(connection);
    exchange->head = HeadLayout(method, url, version);
    MHD_get_connection_values(connection, MHD_GET_ARGUMENT_KIND, OnQuery, exchange.get());
    MHD_get_connection_values(connection, MHD_HEADER_KIND, OnHeader, exchange.get());
    const auto* size = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_REQUEST_HEADER_SIZE);
    if (size == nullptr || !exchange->head.IsWhole(size->header_size)) exchange->malformed = true;
    if (Connection* known = ConnectionOf(connection)) {
      known->has_head = true;
      exchange->request.connected_at = known->begun;
    }
    transport.exchanges_.push_back(exchange.get());
    *context = new std::shared_ptr<Exchange>(exchange);
    if (auto refusal = RefuseByHead(transport, *exchange, transport.options_.max_body_bytes)) {
      exchange->response = std::move(*refusal);
      exchange->started = true;
      // An answer before the complete request ends the connection, so it is used only if a body
      // would have to be read for nothing.
      const bool has_body = !exchange->request.Header("transfer-encoding").empty() ||
                            exchange->malformed ||
                            (!exchange->request.Header("content-length").empty() &&
                             exchange->request.Header("content-length") != "0");
      if (has_body) return Queue(transport, *exchange);
    }
    return MHD_YES;
  }

  static MHD_Result OnRequest(void* self, MHD_Connection* connection, const char* url,
                              const char* method, const char* version, const char* upload,
                              std::size_t* upload_size, void** context) {
    auto& transport = *static_cast<Transport*>(self);
    try {
      if (*context == nullptr) {
        const ScopedLoopLabel label(transport.options_, "the head of a request");
        return Begin(transport, connection, url, method, version, context);
      }
      const std::shared_ptr<Exchange> exchange = *static_cast<std::shared_ptr<Exchange>*>(*context);
      if (*upload_size > 0) {
        // Too long without a stated length: an upload cannot be answered in the middle.
        if (!exchange->TakeBody({upload, *upload_size})) return MHD_NO;
        *upload_size = 0;
        return MHD_YES;
      }
      if (Connection* known = ConnectionOf(connection)) known->receiving = false;
      if (!exchange->started && !exchange->HasWholeUpload()) return MHD_YES;
      if (!exchange->started) {
        exchange->started = true;
        if (exchange->request.upload) transport.has_whole_upload_ = true;
        const ScopedLoopLabel label(
            transport.options_, transport.options_.doing ? exchange->route->Name() : std::string());
        Gate::Handle(*exchange->route, exchange->request,
                     [weak = std::weak_ptr(exchange)](Response response) {
                       if (const auto alive = weak.lock()) alive->Answer(std::move(response));
                     });
      }
      if (exchange->response) return Queue(transport, *exchange);
      exchange->Suspend();
      return MHD_YES;
    } catch (const std::exception&) {
      return MHD_NO;
    }
  }

  static ssize_t ReadStream(void* cls, std::uint64_t, char* buffer, std::size_t max) {
    Exchange& exchange = **static_cast<std::shared_ptr<Exchange>*>(cls);
    EventStream& stream = *exchange.stream;
    if (stream.empty()) {
      if (stream.closed()) return MHD_CONTENT_READER_END_OF_STREAM;
      exchange.Suspend();
      return 0;
    }
    const std::string_view bytes = stream.Peek(max);
    std::memcpy(buffer, bytes.data(), bytes.size());
    const std::size_t count = bytes.size();
    stream.Take(count);
    return static_cast<ssize_t>(count);
  }

  static ssize_t ReadFile(void* cls, std::uint64_t at, char* buffer, std::size_t max) {
    const auto count =
        (*static_cast<std::shared_ptr<Exchange>*>(cls))->NextPiece(at, {buffer, max});
    return count ? static_cast<ssize_t>(*count) : MHD_CONTENT_READER_END_WITH_ERROR;
  }

  static void FreeStream(void* cls) { delete static_cast<std::shared_ptr<Exchange>*>(cls); }

  static MHD_Response* MakeStream(Transport& transport, Exchange& exchange) {
    exchange.stream = transport.hub_.Open(exchange.request.session);
    exchange.stream->wake = [&exchange] { exchange.Resume(); };
    exchange.stream->cut = [&exchange] {
      CutSocket(exchange.connection);
      exchange.Resume();
    };
    transport.send_initial_events_(*exchange.stream);
    auto held = std::make_unique<std::shared_ptr<Exchange>>(exchange.shared_from_this());
    return MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, kStreamBlock, ReadStream,
                                             held.release(), FreeStream);
  }

  /// A body that the library holds until it is sent or its connection ends.
  struct UnsentBody {
    std::string bytes;
    std::size_t& all_unsent;

    UnsentBody(std::string body, std::size_t& unsent) : bytes(std::move(body)), all_unsent(unsent) {
      all_unsent += bytes.size();
    }
    ~UnsentBody() { all_unsent -= bytes.size(); }
    UnsentBody(const UnsentBody&) = delete;
    UnsentBody& operator=(const UnsentBody&) = delete;
  };

  static void FreeBody(void* cls) { delete static_cast<UnsentBody*>(cls); }

  /// Replaces a large body by a refusal while too much waits for slow readers.
  static void BoundUnsent(const Transport& transport, Exchange& exchange) {
    const HttpServerOptions& options = transport.options_;
    const std::size_t size = exchange.response->body.size();
    const std::size_t unsent = transport.unsent_bytes_;
    if (size <= options.small_answer_bytes ||
        (unsent <= options.max_unsent_bytes && size <= options.max_unsent_bytes - unsent))
      return;
    exchange.response = RetryLater(503, say::web::TooMuchSent(), std::chrono::seconds(5));
  }

  /// Takes the body: there is never a second copy of it.
  static MHD_Response* MakeFromMemory(Transport& transport, Exchange& exchange) {
    BoundUnsent(transport, exchange);
    auto body =
        std::make_unique<UnsentBody>(std::move(exchange.response->body), transport.unsent_bytes_);
    MHD_Response* made = MHD_create_response_from_buffer_with_free_callback_cls(
        body->bytes.size(), body->bytes.data(), FreeBody, body.get());
    if (made != nullptr) static_cast<void>(body.release());  // FreeBody() has it from now on
    return made;
  }

  static MHD_Response* MakeBody(Transport& transport, Exchange& exchange) {
    Response& response = *exchange.response;
    if (response.event_stream && !exchange.head_only) {
      if (MHD_Response* stream = MakeStream(transport, exchange)) return stream;
    }
    if (response.file) {
      auto held = std::make_unique<std::shared_ptr<Exchange>>(exchange.shared_from_this());
      return MHD_create_response_from_callback(response.file->size(), kFileBlock, ReadFile,
                                               held.release(), FreeStream);
    }
    if (!response.constant_body.empty()) {
      return MHD_create_response_from_buffer(response.constant_body.size(),
                                             const_cast<char*>(response.constant_body.data()),
                                             MHD_RESPMEM_PERSISTENT);
    }
    return MakeFromMemory(transport, exchange);
  }

  static MHD_Result Queue(Transport& transport, Exchange& exchange) {
    MHD_Response* made = MakeBody(transport, exchange);
    if (made == nullptr) return MHD_NO;
    Response& response = *exchange.response;
    AddSecurityHeaders(response, transport.gate_.CertificateLeft());
    MHD_add_response_header(made, MHD_HTTP_HEADER_CONTENT_TYPE, response.type.c_str());
    for (const auto& [name, value] : response.headers)
      MHD_add_response_header(made, name.c_str(), value.c_str());
    const MHD_Result queued =
        MHD_queue_response(exchange.connection, static_cast<unsigned>(response.status), made);
    MHD_destroy_response(made);
    return queued;
  }
};

Transport::Transport(const HttpServerOptions& options, BackgroundWork& background,
                     const Router& router, SessionLookup& sessions, EventHub& hub,
                     std::function<void(EventStream&)> send_initial_events)
    : options_(options),
      background_(background),
      gate_(router, sessions, options.host_names, options.tls.has_value()),
      hub_(hub),
      send_initial_events_(std::move(send_initial_events)),
      connections_(options_),
      wake_fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (wake_fd_ < 0) throw IoError(say::web::CannotMakeEventfd(std::strerror(errno)));
  try {
    if (options_.tls) Serve(*options_.tls);
    Start(options.listen_fd ? *options.listen_fd : OpenListenSocket(options.address, options.port));
  } catch (...) {
    close(wake_fd_);
    throw;
  }
}

void Transport::Start(int listen_fd) {
  port_ = PortOf(listen_fd);
  unsigned flags = MHD_USE_EPOLL | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_ITC;
  if (IsIpv6(listen_fd)) flags |= MHD_USE_IPv6;
  std::string priorities = kTlsPriorities;
  std::vector<MHD_OptionItem> extra;
  if (options_.tls) {
    flags |= MHD_USE_TLS;
    extra.push_back(
        {MHD_OPTION_HTTPS_CERT_CALLBACK, 0, reinterpret_cast<void*>(&Callbacks::OnHandshake)});
    extra.push_back({MHD_OPTION_HTTPS_PRIORITIES, 0, priorities.data()});
  }
  extra.push_back({MHD_OPTION_END, 0, nullptr});
  daemon_ = MHD_start_daemon(
      flags, 0, nullptr, nullptr, &Callbacks::OnRequest, this, MHD_OPTION_LISTEN_SOCKET, listen_fd,
      MHD_OPTION_CONNECTION_LIMIT, options_.max_connections, MHD_OPTION_CONNECTION_MEMORY_LIMIT,
      options_.connection_memory_bytes, MHD_OPTION_CONNECTION_TIMEOUT,
      static_cast<unsigned>(options_.request_timeout.count()), MHD_OPTION_STRICT_FOR_CLIENT, 1,
      MHD_OPTION_UNESCAPE_CALLBACK, &Callbacks::KeepEscapes, nullptr, MHD_OPTION_NOTIFY_COMPLETED,
      &Callbacks::OnCompleted, this, MHD_OPTION_NOTIFY_CONNECTION, &Callbacks::OnConnection, this,
      MHD_OPTION_ARRAY, extra.data(), MHD_OPTION_END);
  if (daemon_ == nullptr) {
    if (!options_.listen_fd) close(listen_fd);
    throw IoError(options_.tls ? say::web::NoHttpsServer(port_) : say::web::NoHttpServer(port_));
  }
  epoll_fd_ = MHD_get_daemon_info(daemon_, MHD_DAEMON_INFO_EPOLL_FD)->epoll_fd;
}

Transport::~Transport() {
  // The library cannot stop while connections are suspended.
  for (Exchange* exchange : std::list(exchanges_)) {
    if (!exchange->response) exchange->response = ErrorResponse(503, say::web::Stopping());
    exchange->Resume();
  }
  RunLibrary();
  for (Exchange* exchange : std::list(exchanges_)) exchange->Resume();
  MHD_stop_daemon(daemon_);
  close(wake_fd_);
}

void Transport::Run() {
  std::uint64_t count = 0;
  [[maybe_unused]] const auto drained = read(wake_fd_, &count, sizeof count);
  const auto now = std::chrono::steady_clock::now();
  for (Exchange* exchange : exchanges_)
    if (exchange->try_again_at && *exchange->try_again_at <= now) exchange->Resume();
  RunLibrary();
}

void Transport::RunLibrary() {
  serving = this;
  const auto until = std::chrono::steady_clock::now() + kRunsATurn;
  do {
    MHD_run(daemon_);
  } while (LibraryTimeout() == std::chrono::milliseconds(0) &&
           std::chrono::steady_clock::now() < until);
  serving = nullptr;
}

void Transport::Serve(const TlsIdentity& identity) {
  certificates_.push_back(std::make_unique<ServedCertificate>(identity));
}

void Transport::Wake() const {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written =
      write(wake_fd_, &one, sizeof one);  // cannot fail below 2^64 - 1
}

std::optional<std::chrono::milliseconds> Transport::timeout() const {
  auto wait = LibraryTimeout();
  const auto now = std::chrono::steady_clock::now();
  for (const Exchange* exchange : exchanges_) {
    if (!exchange->try_again_at) continue;
    const auto left =
        std::max(std::chrono::milliseconds(0),
                 std::chrono::ceil<std::chrono::milliseconds>(*exchange->try_again_at - now));
    wait = std::min(wait.value_or(left), left);
  }
  return wait;
}

std::optional<std::chrono::milliseconds> Transport::LibraryTimeout() const {
  MHD_UNSIGNED_LONG_LONG wait_ms = 0;
  if (MHD_get_timeout(daemon_, &wait_ms) != MHD_YES) return std::nullopt;
  return std::chrono::milliseconds(wait_ms);
}

void Transport::CutOlderThan(Connection::TimePoint time) {
  while (const Connection* old = connections_.NextOlderThan(time)) shutdown(old->fd, SHUT_RDWR);
}

void Transport::CutLate() {
  const auto now = options_.now();
  while (const Connection* late = connections_.NextLate(now)) shutdown(late->fd, SHUT_RDWR);
}

}  // namespace plumb::web

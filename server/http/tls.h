#pragma once

// Private to server/http: TLS under a session.
#include "server/http/session.h"
// session.h stays first.
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <memory>

namespace joulecast::http {

using TlsStream = net::ssl::stream<Socket>;

// TLS 1.2 or newer. Errors name the setting.
Result<std::shared_ptr<net::ssl::context>> make_tls(const TlsFiles& files);

// As make_session, with the core's certificate.
std::shared_ptr<Session> make_tls_session(std::shared_ptr<Core> core, Socket socket, Caller caller);

// Declared before stream_session.h, where a template calls them.
inline Task<bool> open_stream(TlsStream& stream) {
  boost::system::error_code error;
  co_await stream.async_handshake(net::ssl::stream_base::server, net::redirect_error(use_task, error));
  co_return !error;
}
inline Task<void> end_stream(TlsStream& stream) {
  boost::system::error_code ignored;
  co_await stream.async_shutdown(net::redirect_error(use_task, ignored));
}

}  // namespace joulecast::http

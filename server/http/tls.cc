#include "server/http/tls.h"
// tls.h stays first.
#include <openssl/ssl.h>

#include <utility>

#include "server/http/stream_session.h"

namespace joulecast::http {

Result<std::shared_ptr<net::ssl::context>> make_tls(const std::string& certificate, const std::string& key) {
  if (certificate.empty() || key.empty())
    return invalid(certificate.empty() ? "http.tls_certificate" : "http.tls_key",
                   "is needed where the other of the two is given");
  auto context = std::make_shared<net::ssl::context>(net::ssl::context::tls_server);
  SSL_CTX* native = context->native_handle();
  SSL_CTX_set_min_proto_version(native, TLS1_2_VERSION);
  SSL_CTX_set_options(native, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  boost::system::error_code error;
  context->use_certificate_chain_file(certificate, error);
  if (error) return invalid("http.tls_certificate", "cannot use " + certificate + ": " + error.message());
  context->use_private_key_file(key, net::ssl::context::pem, error);
  if (error) return invalid("http.tls_key", "cannot use " + key + ": " + error.message());
  return context;
}

std::shared_ptr<Session> make_tls_session(std::shared_ptr<Core> core, Socket socket,
                                          const net::ip::address& peer, bool guest) {
  TlsStream stream(std::move(socket), *core->tls);
  return std::make_shared<StreamSession<TlsStream>>(std::move(core), std::move(stream), peer, guest);
}

}  // namespace joulecast::http

#include "server/http/tls.h"
// tls.h stays first.
#include <openssl/ssl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "access/secret_file.h"
#include "server/http/stream_session.h"

namespace joulecast::http {

Result<std::shared_ptr<net::ssl::context>> make_tls(const TlsFiles& files) {
  if (files.certificate.empty())
    return invalid("http.tls_certificate", "is needed where another file of TLS is given");
  if (files.key.empty()) return invalid("http.tls_key", "is needed where http.tls_certificate is given");
  auto context = std::make_shared<net::ssl::context>(net::ssl::context::tls_server);
  SSL_CTX* native = context->native_handle();
  SSL_CTX_set_min_proto_version(native, TLS1_2_VERSION);
  SSL_CTX_set_options(native, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  // Of TLS 1.2, Mozilla's intermediate recommendation: https://wiki.mozilla.org/Security/Server_Side_TLS
  if (SSL_CTX_set_cipher_list(native, "ECDHE+AESGCM:ECDHE+CHACHA20:DHE+AESGCM:DHE+CHACHA20") != 1)
    return fail(Fault::internal, "http.tls_certificate", "OpenSSL has none of the recommended ciphers");
  // Opening a pipe waits for a program that writes to it.
  for (const auto& [setting, file] : {std::pair("http.tls_certificate", files.certificate),
                                      {"http.tls_key", files.key},
                                      {"http.tls_client_authorities", files.client_authorities}}) {
    std::error_code unknown;
    if (std::filesystem::is_fifo(file, unknown)) return invalid(setting, file + " is a pipe, must be a file");
  }
  boost::system::error_code error;
  const auto unusable = [&](const char* setting, const std::string& file) {
    const bool readable = ::access(file.c_str(), R_OK) == 0;
    return invalid(setting,
                   "cannot use " + file + ": " + (readable ? error.message() : std::strerror(errno)));
  };
  context->use_certificate_chain_file(files.certificate, error);
  if (error) return unusable("http.tls_certificate", files.certificate);
  const Result<std::string> key = access::read_guarded_file(files.key, true);
  if (!key) return invalid("http.tls_key", "cannot use " + describe(key.error()));
  context->use_private_key(net::buffer(*key), net::ssl::context::pem, error);
  if (error) return unusable("http.tls_key", files.key);
  if (files.client_authorities.empty()) return context;
  context->load_verify_file(files.client_authorities, error);
  if (error) return unusable("http.tls_client_authorities", files.client_authorities);
  context->set_verify_mode(net::ssl::verify_peer | net::ssl::verify_fail_if_no_peer_cert);
  // Without a name of their own OpenSSL refuses to resume sessions of clients that it has verified.
  constexpr unsigned char sessions[] = "joulecastd";
  SSL_CTX_set_session_id_context(native, sessions, sizeof sessions - 1);
  SSL_CTX_set_client_CA_list(native, SSL_load_client_CA_file(files.client_authorities.c_str()));
  return context;
}

std::shared_ptr<Session> make_tls_session(std::shared_ptr<Core> core, Socket socket, Caller caller) {
  TlsStream stream(std::move(socket), *core->tls);
  return std::make_shared<StreamSession<TlsStream>>(std::move(core), std::move(stream), std::move(caller));
}

}  // namespace joulecast::http

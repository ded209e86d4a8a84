#include "access/sha256.h"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <openssl/rand.h>

#include <boost/algorithm/hex.hpp>
#include <cstdlib>
#include <span>
#include <vector>

namespace joulecast::access {
namespace {

std::string_view as_text(std::span<const unsigned char> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

std::string hexadecimal(std::string_view bytes) {
  return boost::algorithm::hex_lower(std::string(bytes));
}

std::optional<std::string> from_hexadecimal(std::string_view text) try {
  return boost::algorithm::unhex(std::string(text));
} catch (const boost::algorithm::hex_decode_error&) {
  return std::nullopt;
}

std::string sha256_hex(std::string_view bytes) {
  std::array<unsigned char, 32> digest{};
  unsigned length = 0;
  // Fails only without memory or without the algorithm; no hash can be trusted then.
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), &length, EVP_sha256(), nullptr) != 1 ||
      length != digest.size())
    std::abort();
  return hexadecimal(as_text(digest));
}

std::array<std::uint8_t, 32> hmac_sha256(std::string_view key, std::string_view bytes) {
  std::array<std::uint8_t, 32> mac{};
  unsigned length = 0;
  const auto* at = reinterpret_cast<const unsigned char*>(bytes.data());
  const void* made =
      HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()), at, bytes.size(), mac.data(), &length);
  if (made == nullptr || length != mac.size()) std::abort();
  return mac;
}

bool equal_in_constant_time(std::string_view a, std::string_view b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

std::string random_hex(int bytes) {
  std::vector<unsigned char> drawn(static_cast<std::size_t>(bytes));
  if (RAND_bytes(drawn.data(), bytes) != 1) std::abort();
  return hexadecimal(as_text(drawn));
}

}  // namespace joulecast::access

#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "server/http/message.h"

// Content codings of answers (RFC 9110 section 8.4).
namespace joulecast::http {

enum class Coding : std::uint8_t { identity, gzip, zstd };

std::string_view name(Coding coding);

// The coding to answer with: zstd before gzip, since it takes less time for fewer bytes; weights other than
// q=0 are not looked at.
Coding coding_of(std::string_view accept_encoding);

// The coded form; empty when the library fails, which it does for want of memory alone.
std::string coded(Coding coding, std::string_view bytes);

// gzip (RFC 1952) at its smallest, for bodies that are coded once and sent often.
std::string gzip_smallest(std::string_view bytes);

// A stream with coded pieces; the inner stream's output before it waits is flushed.
std::shared_ptr<StreamSource> coded(Coding coding, std::shared_ptr<StreamSource> inner);

}  // namespace joulecast::http

#pragma once

#include <span>
#include <string_view>

// Files of the source tree that are part of the program, written at build time by server/embed.cmake.
namespace joulecast {

struct EmbeddedFile {
  std::string_view name;  // relative to its folder
  std::string_view bytes;
};

std::span<const EmbeddedFile> embedded_examples();   // schemas/examples/*.json
std::span<const EmbeddedFile> embedded_web();        // the operator page, server/web
std::span<const EmbeddedFile> embedded_reference();  // reference.html and reference.css, server/reference

}  // namespace joulecast

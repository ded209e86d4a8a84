#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "server/embedded.h"
#include "server/http/router.h"

namespace joulecast::http {

// Endpoints that serve files from memory, one a file, with "index.html" also at "/" and other pages also
// without ".html". Only the names in `files` are served, so no request can reach another file. Answers carry
// an ETag, a strict content security policy and, if it is smaller and the client accepts it, the gzip form;
// names with a content hash
// ("app.3f9a1c2b.js") may be cached permanently, others are revalidated.
std::vector<Endpoint> asset_endpoints(std::span<const EmbeddedFile> files);

// The same from the regular files directly in a directory of the disk, read once. Symbolic links and names
// with a leading dot are left out. Fault::not_found when it cannot be read.
Result<std::vector<Endpoint>> asset_endpoints_from(const std::string& directory);

}  // namespace joulecast::http

#include "dynamics/catalogue_text.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "dynamics/catalogue.h"

namespace joulecast::dynamics {
namespace {

TEST(CatalogueText, MatchesTheDocument) {
  std::ifstream in(JOULECAST_SOURCE_DIR "/deploy/documents/effects.md", std::ios::binary);
  const std::string document{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  EXPECT_EQ(document, catalogue_markdown()) << "joulecast effects --markdown > deploy/documents/effects.md";
}

TEST(CatalogueText, ListsEveryEffectAndParameter) {
  const std::string document = catalogue_markdown(), listing = catalogue_listing();
  for (const Effect* effect : catalogue()) {
    EXPECT_NE(document.find(std::string("### `").append(effect->info().id).append("`\n")), std::string::npos);
    EXPECT_NE(listing.find(std::string("  ").append(effect->info().id).append(": ")), std::string::npos);
    for (const EffectParameter& p : effect->info().parameters) {
      EXPECT_NE(document.find(std::string("`").append(p.name).append("`")), std::string::npos) << p.name;
    }
  }
}

}  // namespace
}  // namespace joulecast::dynamics

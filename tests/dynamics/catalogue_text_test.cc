#include <gtest/gtest.h>

#include <string>

#include "dynamics/catalogue.h"

namespace joulecast::dynamics {
namespace {

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

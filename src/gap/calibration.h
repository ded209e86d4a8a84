#pragma once

namespace joulecast::gap {

// How the answer that names an effect stands.
enum class Standing {
  alone,         // the verdict is "effects", and nothing else would do in its place
  grouped,       // the same, with others that the data cannot tell from it
  inconclusive,  // something speaks against the answer as a whole
  outside        // named beside something that the catalogue does not know
};

// The probability to state for an effect so named: `posterior`, moved to how often such names came true.
double stated_probability(double posterior, Standing standing);

}  // namespace joulecast::gap

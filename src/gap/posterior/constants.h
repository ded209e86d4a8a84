#pragma once

#include <array>
#include <cstddef>

// Every constant of the posterior. The table of tests/study/method.md states the source of each, or the
// measured effect of changing it; tests/study/check_constants.py compares the two.
namespace joulecast::gap::posterior {

// --- rows and blocks
inline constexpr double line_s = 0.4, line_rows = 2.2;    // half of the line about a reading [s], [rows]
inline constexpr std::array line_lengths{1.0, 2.0, 4.0};  // of it, for the acceleration
inline constexpr double row_s = 0.5, row_readings = 2;    // of battery power
inline constexpr double knot_s = 0.25;                    // between the ends of pieces of a row
inline constexpr double surely_better = 3;                // sd of a difference of squares
inline constexpr std::size_t row_instants = 3;            // of a row at which the model is evaluated
inline constexpr std::size_t most_power_rows = 10000, most_windows = 4000;
inline constexpr std::size_t fewest_windows = 40, fewest_rows = 20;  // of recordings, of a channel
inline constexpr double block_count = 20, shortest_block_s = 8;
inline constexpr std::size_t most_blocks = 40;  // above, missions share blocks

// --- prior of the effects, by the strength that moves mean power by 100 %
inline constexpr double expected_effects = 0.5, expected_function = 0.1;
inline constexpr std::array slab_shares{0.02, 0.06, 0.2, 0.6};  // sd
inline constexpr std::array function_shares{0.03, 0.15};
inline constexpr double usual_slab = 0.06;  // where one of them is enough: pairs with a function, directions
inline constexpr double usual_slab_of = 0.2;  // at which a strength has its usual deviation (traits.h)
inline constexpr double least_gap = 0.02;     // a slab is no wider than the gap or this
// Divisors of prior odds: places of a zone that were searched; a bias of the battery current alone.
inline constexpr double searched_zones = 50.0 / 3, bias_alone = 3;

// --- prior of the parameters of every robot: tolerance and scatter, times a common factor
inline constexpr std::array tolerance_factors{1.0, 3.0, 10.0, 60.0};
inline constexpr std::array tolerance_factor_prior{0.5, 0.3, 0.1, 0.1};
inline constexpr double most_scatter_factor = 10;  // on scatter
inline constexpr double most_function_factor = 3;  // where no parameter of a file corresponds
// By power: effects that no file has; functions; most by traits.h; least of viscous friction. A load: of the
// file's idle power and of the mean power, and its scatter.
inline constexpr double effect_tolerance = 0.0025, function_tolerance = 0.003, most_tolerance = 0.02,
                        least_viscous = 0.002, idle_tolerance = 0.006, load_tolerance = 0.0005,
                        idle_scatter = 0.008;
inline constexpr double inductance_tolerance_h = 1e-5, usual_inductance_h = 0.01;
// Nuisances: sides of resistance and of friction, zeros of sensors over their ranges, open-circuit voltage
// and its fall over the charge, zero of the gyro, yaw inertia of a kilogram of payload beyond the contract's.
inline constexpr double resistance_sides = 0.01, viscous_sides = 0.05, current_zero = 0.0007,
                        voltage_zero = 0.0004, battery_level = 0.15, battery_fall = 0.5,
                        gyro_zero_rad_s = 0.01, payload_yaw_m2 = 0.1;
inline constexpr double table_shift = 0.02;  // common deviation of the energies of a table of runs

// --- noise
inline constexpr double outlier = 3.5;  // spreads
inline constexpr std::size_t fewest_of_class = 30, size_classes = 4;
inline constexpr double least_spread = 0.05;  // of the largest class's
inline constexpr double likely_share = 0.3;   // of the power: sd of every coefficient in the ridge fit
inline constexpr std::size_t fewest_blocks = 6;

// --- search
inline constexpr std::size_t most_effects = 4;  // in a set; one less with a function
inline constexpr std::size_t extended_sets = 60, extended_with_function = 15, kept_pairs = 200,
                             kept_larger = 100;
inline constexpr std::size_t kept_models = 200, kept_configurations = 7, models_with_subsets = 40;
inline constexpr double alike = 0.95;        // correlation of columns that are never in one set
inline constexpr double not_seen = 0.5;      // nats: most that an effect without influence could gain
inline constexpr double hopeless_nats = 30;  // below the best single effect: functions that are not extended

// --- walk
inline constexpr int most_steps = 6;
inline constexpr double near_file = 0.06;  // of the power: no walk where less is explained
inline constexpr double settled = 0.05, settled_power = 0.02, improved = 0.999;
inline constexpr std::array step_lengths{1.0, 0.6, 0.3, 0.1};
inline constexpr int most_delay_rounds = 3;
inline constexpr double settled_delay_s = 0.006;

// --- bagging and decision
inline constexpr int resamples = 16;
inline constexpr double least_effect = 0.01, least_function = 0.02;  // of the power: less counts as none
inline constexpr double least_listed = 1.0 / resamples;
inline constexpr std::size_t most_alternatives = 2;
inline constexpr double named = 0.5;       // probability of a name
inline constexpr double considered = 0.3;  // of a function, where no effect is constant
// Relative scatter of a strength between blocks, prior of the first, and most of a constant strength.
inline constexpr std::array wander_scales{0.0, 0.15, 0.3, 0.6, 1.2, 2.4};
inline constexpr double constant_prior = 0.5, most_wander = 0.5;
inline constexpr std::size_t folds = 8;
inline constexpr double clear_gain = 0.01;  // of the power: a difference of held-out errors that counts
inline constexpr double bound_part =
    0.01;                                 // of an end of its range: a strength this near to it is no estimate
inline constexpr double withheld = 0.49;  // probability of an effect that a gate withholds
inline constexpr double least_gap_share = 0.05, most_gap_share = 2;  // of the removed gap, for a named effect
inline constexpr double detected_sd = 3.5, detected_part = 0.9;      // of the effects
inline constexpr double detectable = 0.04;                           // of the power: "none" needs this
inline constexpr double mismatched_file = 0.3;  // of the power: residual of the file beyond the explanation
inline constexpr double repeats_s = 2, repeats_left = 0.85;
inline constexpr std::size_t time_missions = 2;  // functions of time
inline constexpr double revisit_s = 20;          // functions of place

// --- terms and sums
inline constexpr int term_draws = 100;
inline constexpr double joined_deviation = 0.5, joined_alike = 0.9, known_part = 0.3;
inline constexpr double shown_part = 0.002;             // of the power: smallest term shown
inline constexpr double term_sd = 3, term_part = 0.02;  // smallest reported sum; of the power
inline constexpr double same_form = 0.97;               // R^2 of an effect's power by the terms of a sum
inline constexpr double equivalent = 0.01;              // of the power: the parameter takes the sum
inline constexpr double rounding = 1e-9;                // of a term in all rows: what is smaller is zero

}  // namespace joulecast::gap::posterior

#pragma once
/// The way in which an error is passed on.

#include <tl/expected.hpp>

/// Returns the error of a tl::expected, if it holds one, from the function:
///     ABBE_TRY(check(options));
///     const auto model = read_model(file);
///     ABBE_TRY(model);
/// The error is returned as it is, so that the message names what was read, not who read it.
#define ABBE_TRY(...)                                     \
  do {                                                    \
    if (auto&& abbe_tried = (__VA_ARGS__); !abbe_tried) { \
      return tl::make_unexpected(abbe_tried.error());     \
    }                                                     \
  } while (false)

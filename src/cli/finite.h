// A check for options that take any number.
#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <string>

namespace isotrack::cli {

/// Refuses "nan" and "inf", which parse as numbers.
inline CLI::Validator finite() {
    return CLI::Validator(
        [](const std::string& text) {
            double value = 0.0;
            return CLI::detail::lexical_cast(text, value) && !std::isfinite(value)
                       ? "must be a finite number, got " + text
                       : std::string();
        },
        "");
}

}  // namespace isotrack::cli

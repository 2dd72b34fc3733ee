// Rows of values as text for people, or as CSV or JSON for programs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace isotrack::cli {

enum class TableFormat { Text, Csv, Json };

/// `rows`: an array of objects with the same keys in the same order; the keys are the header. Text has
/// aligned columns and four significant digits, CSV and JSON all of them. No value (null) is "-" in text,
/// empty in CSV; not a finite number is null in JSON.
std::string format_table(const nlohmann::ordered_json& rows, TableFormat format);

}  // namespace isotrack::cli

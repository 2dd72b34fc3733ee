#include "cli/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

namespace isotrack::cli {
namespace {

using Json = nlohmann::ordered_json;

std::string text_of(const Json& value) {
    if (value.is_null()) return "-";
    if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
    if (value.is_number_float()) return fmt::format("{:.4g}", value.get<double>());
    return value.is_string() ? value.get<std::string>() : value.dump();
}

std::string csv_of(const Json& value) {
    if (value.is_null()) return "";
    if (value.is_number_float()) return fmt::format("{}", value.get<double>());
    if (!value.is_string()) return value.dump();
    const std::string text = value.get<std::string>();
    if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
    std::string quoted = "\"";
    for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
    return quoted + '"';
}

std::string aligned(const Json& rows) {
    std::vector<std::vector<std::string>> lines(rows.size() + 1);
    std::vector<bool> to_the_left;
    for (const auto& [key, value] : rows.front().items()) {
        lines[0].push_back(key);
        to_the_left.push_back(value.is_string());
    }
    for (std::size_t i = 0; i < rows.size(); ++i)
        for (const auto& item : rows[i].items()) lines[i + 1].push_back(text_of(item.value()));
    std::vector<std::size_t> width(lines[0].size());
    for (const auto& line : lines)
        for (std::size_t k = 0; k < line.size(); ++k) width[k] = std::max(width[k], line[k].size());

    std::string result;
    for (const auto& line : lines) {
        std::string text;
        for (std::size_t k = 0; k < line.size(); ++k)
            text += to_the_left[k] ? fmt::format("{:<{}}  ", line[k], width[k])
                                   : fmt::format("{:>{}}  ", line[k], width[k]);
        result += text.substr(0, text.find_last_not_of(' ') + 1) + '\n';
    }
    return result;
}

std::string comma_separated(const Json& rows) {
    std::string header, lines;
    for (const auto& item : rows.front().items()) header += (header.empty() ? "" : ",") + csv_of(item.key());
    for (const Json& row : rows) {
        bool first = true;
        for (const auto& item : row.items()) {
            if (!first) lines += ',';
            lines += csv_of(item.value());
            first = false;
        }
        lines += '\n';
    }
    return header + '\n' + lines;
}

}  // namespace

std::string format_table(const Json& rows, TableFormat format) {
    // File names need not be UTF-8; JSON must be.
    if (format == TableFormat::Json) return rows.dump(1, ' ', false, Json::error_handler_t::replace) + '\n';
    if (rows.empty()) return "";
    return format == TableFormat::Csv ? comma_separated(rows) : aligned(rows);
}

}  // namespace isotrack::cli

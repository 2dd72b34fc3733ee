#include "isotrack/io/sequence.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <filesystem>
#include <string_view>
#include <system_error>

#include "isotrack/error.h"

namespace isotrack {
namespace {

namespace fs = std::filesystem;

// Far more frames than anybody has; beyond it two files are not of one sequence (a date in a name, say).
constexpr long kMaxGaps = 1'000'000;

bool is_digit(char c) {
    return std::isdigit(static_cast<unsigned char>(c)) != 0;
}

/// Where the frame number stands in a pattern.
struct Field {
    std::size_t begin, length;
    std::size_t min_digits;
};

/// The field that starts at `begin`, if one does.
std::optional<Field> field_at(const std::string& text, std::size_t begin) {
    if (text[begin] == '#') {
        const std::size_t end = std::min(text.find_first_not_of('#', begin), text.size());
        return Field{begin, end - begin, end - begin};
    }
    if (text.compare(begin, 2, "{}") == 0) return Field{begin, 2, 1};
    if (text[begin] == '%') {
        std::size_t end = begin + 1;
        while (end < text.size() && is_digit(text[end])) ++end;
        if (end == text.size() || text[end] != 'd') return std::nullopt;
        std::size_t width = 1;
        std::from_chars(text.data() + begin + 1, text.data() + end, width);
        if (width > 99)
            throw OptionError(fmt::format("'{}': a frame number of {} digits is too wide", text, width));
        return Field{begin, end + 1 - begin, std::max<std::size_t>(width, 1)};
    }
    return std::nullopt;
}

std::optional<Field> find_field(const std::string& pattern) {
    std::optional<Field> found;
    for (std::size_t i = 0; i < pattern.size();) {
        const std::optional<Field> field = field_at(pattern, i);
        if (field && found)
            throw OptionError(fmt::format(
                "'{}' has two fields for the frame number; keep one of ####, %04d, %d or {{}}", pattern));
        if (field) found = field;
        i += field ? field->length : 1;
    }
    return found;
}

std::optional<int> to_int(std::string_view text) {
    int value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

/// The last run of digits of the file's stem; nullopt without digits or where they do not fit an int.
std::optional<int> number_in_name(const fs::path& path) {
    const std::string stem = path.stem().string();
    std::size_t end = stem.size();
    while (end > 0 && !is_digit(stem[end - 1])) --end;
    std::size_t begin = end;
    while (begin > 0 && is_digit(stem[begin - 1])) --begin;
    return to_int(std::string_view(stem).substr(begin, end - begin));
}

/// Runs of digits compare as numbers of any length, all else byte by byte.
bool natural_less(const std::string& a, const std::string& b) {
    std::size_t i = 0, j = 0;
    while (i < a.size() && j < b.size()) {
        if (!is_digit(a[i]) || !is_digit(b[j])) {
            if (a[i] != b[j]) return a[i] < b[j];
            ++i, ++j;
            continue;
        }
        const auto run = [](const std::string& text, std::size_t& at) {
            while (at < text.size() && text[at] == '0') ++at;
            const std::size_t begin = at;
            while (at < text.size() && is_digit(text[at])) ++at;
            return std::string_view(text).substr(begin, at - begin);
        };
        const std::string_view x = run(a, i), y = run(b, j);
        if (x.size() != y.size()) return x.size() < y.size();
        if (x != y) return x < y;
    }
    if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
    return a < b;  // "1" and "01": equal as numbers, yet the order must not depend on the folder
}

/// Everything in a folder but folders and hidden files; macOS leaves a hidden `._name.vdb` beside each file.
std::vector<fs::path> files_in(const fs::path& folder) {
    std::error_code error;
    std::vector<fs::path> files;
    fs::directory_iterator entry(folder, error), end;
    for (; !error && entry != end; entry.increment(error)) {
        std::error_code ignored;
        if (!entry->is_directory(ignored) && entry->path().filename().string().front() != '.')
            files.push_back(entry->path());
    }
    if (error)
        throw OptionError(fmt::format("cannot list folder '{}': {}", folder.string(), error.message()));
    return files;
}

bool is_vdb(const fs::path& path) {
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension == ".vdb";
}

std::vector<InputFrame> match_pattern(const std::string& pattern) {
    const fs::path folder = fs::path(pattern).parent_path();
    const std::string name = fs::path(pattern).filename().string();
    find_field(pattern);  // refuses a second field, also one in the folder
    const std::optional<Field> field = find_field(name);
    if (!field)
        throw OptionError(
            fmt::format("'{}': the frame number must be in the file's name, not in the folder's", pattern));
    const std::string_view before = std::string_view(name).substr(0, field->begin);
    const std::string_view after = std::string_view(name).substr(field->begin + field->length);

    std::error_code error;
    const fs::path searched = folder.empty() ? fs::path(".") : folder;
    if (!fs::is_directory(searched, error))
        throw OptionError(fmt::format("'{}': there is no folder '{}'", pattern, searched.string()));

    std::vector<InputFrame> frames;
    for (const fs::path& file : files_in(searched)) {
        const std::string candidate = file.filename().string();
        if (candidate.size() < before.size() + after.size() + field->min_digits) continue;
        const std::string_view view = candidate;
        const std::string_view digits =
            view.substr(before.size(), view.size() - before.size() - after.size());
        if (view.substr(0, before.size()) != before || view.substr(view.size() - after.size()) != after ||
            !std::all_of(digits.begin(), digits.end(), is_digit))
            continue;
        const std::optional<int> number = to_int(digits);
        if (!number) throw OptionError(fmt::format("'{}': frame number too large", file.string()));
        frames.push_back({*number, (folder / candidate).string()});
    }
    if (frames.empty())
        throw OptionError(fmt::format(
            "no file matches '{}' (quote patterns so that the shell leaves them alone)", pattern));
    return frames;
}

/// Numbers for the files of plain lists and folders, in natural order.
std::vector<InputFrame> number_files(std::vector<std::string> paths) {
    std::sort(paths.begin(), paths.end(), natural_less);
    paths.erase(std::unique(paths.begin(), paths.end()), paths.end());
    std::vector<InputFrame> frames;
    for (const std::string& path : paths)
        frames.push_back({number_in_name(path).value_or(static_cast<int>(frames.size())), path});
    return frames;
}

void refuse_duplicates(const std::vector<InputFrame>& frames) {
    for (std::size_t i = 1; i < frames.size(); ++i)
        if (frames[i].number == frames[i - 1].number)
            throw OptionError(
                fmt::format("'{}' and '{}' are both frame {}; name one sequence by a pattern such as "
                            "'name.####.vdb'",
                            frames[i - 1].path, frames[i].path, frames[i].number));
}

std::vector<InputFrame> within(const std::vector<InputFrame>& frames, const FrameRange& range) {
    std::vector<InputFrame> kept;
    for (const InputFrame& frame : frames)
        if (frame.number >= range.first && frame.number <= range.last &&
            (long{frame.number} - range.first) % range.step == 0)
            kept.push_back(frame);
    if (kept.empty())
        throw OptionError(fmt::format(
            "no frame lies in {}:{}:{}; the input has {} from {} to {}", range.first, range.last, range.step,
            frames.size() == 1 ? "one frame," : "frames", frames.front().number, frames.back().number));
    return kept;
}

std::vector<int> gaps(const std::vector<InputFrame>& frames, const FrameRange& range) {
    if ((long{range.last} - range.first) / range.step > kMaxGaps + static_cast<long>(frames.size()))
        throw OptionError(
            fmt::format("only {} files for the frames from {} to {}; choose some by --frames A:B, or "
                        "one sequence by a pattern such as 'name.####.vdb'",
                        frames.size(), range.first, range.last));
    std::vector<int> missing;
    auto next = frames.begin();
    for (long number = range.first; number <= range.last; number += range.step) {
        if (next != frames.end() && next->number == number)
            ++next;
        else
            missing.push_back(static_cast<int>(number));
    }
    return missing;
}

}  // namespace

InputSequence find_frames(const std::vector<std::string>& inputs, const std::optional<FrameRange>& range) {
    if (range && (range->step <= 0 || range->first > range->last))
        throw OptionError(
            fmt::format("frame range {}:{}:{} is empty", range->first, range->last, range->step));

    std::vector<InputFrame> frames;
    std::vector<std::string> plain;
    for (const std::string& input : inputs) {
        std::error_code error;
        const fs::file_status status = fs::status(input, error);
        if (fs::is_directory(status)) {
            const std::size_t before = plain.size();
            for (const fs::path& file : files_in(input))
                if (is_vdb(file)) plain.push_back(file.string());
            if (plain.size() == before)
                throw OptionError(fmt::format("folder '{}' holds no .vdb file", input));
        } else if (fs::exists(status)) {  // before the pattern: a name may really contain a '#'
            plain.push_back(input);
        } else if (has_frame_field(input)) {
            const std::vector<InputFrame> matches = match_pattern(input);
            frames.insert(frames.end(), matches.begin(), matches.end());
        } else {
            throw OptionError(fmt::format("there is no file or folder '{}'", input));
        }
    }
    const std::vector<InputFrame> numbered = number_files(std::move(plain));
    frames.insert(frames.end(), numbered.begin(), numbered.end());
    if (frames.empty())
        throw OptionError("no input; give .vdb files, a folder, or a pattern such as 'name.####.vdb'");

    std::stable_sort(frames.begin(), frames.end(),
                     [](const InputFrame& a, const InputFrame& b) { return a.number < b.number; });
    frames.erase(std::unique(frames.begin(), frames.end(),
                             [](const InputFrame& a, const InputFrame& b) {
                                 return fs::path(a.path).lexically_normal() ==
                                        fs::path(b.path).lexically_normal();
                             }),
                 frames.end());
    refuse_duplicates(frames);

    InputSequence sequence;
    sequence.frames = range ? within(frames, *range) : frames;
    sequence.missing =
        gaps(sequence.frames, range.value_or(FrameRange{frames.front().number, frames.back().number}));
    return sequence;
}

FrameRange parse_frame_range(const std::string& text) {
    std::vector<int> parts;
    for (std::size_t begin = 0; begin <= text.size() && parts.size() < 4;) {
        const std::size_t end = std::min(text.find(':', begin), text.size());
        const std::optional<int> part = to_int(std::string_view(text).substr(begin, end - begin));
        if (!part) {
            parts.clear();
            break;
        }
        parts.push_back(*part);
        begin = end + 1;
    }
    if (parts.empty() || parts.size() > 3)
        throw OptionError(
            fmt::format("frame range must be A, A:B or A:B:STEP in whole numbers, got '{}'", text));
    const FrameRange range{parts[0], parts.size() > 1 ? parts[1] : parts[0], parts.size() > 2 ? parts[2] : 1};
    if (range.last < range.first)
        throw OptionError(fmt::format("frame range '{}' ends before it begins", text));
    if (range.step <= 0)
        throw OptionError(fmt::format("the step of frame range '{}' must be positive", text));
    return range;
}

std::string expand_pattern(const std::string& pattern, int frame) {
    const std::optional<Field> field = find_field(pattern);
    if (!field) return pattern;
    const std::string number =
        fmt::format("{:0{}}", frame, std::max<std::size_t>(field->min_digits, 1) + (frame < 0 ? 1 : 0));
    return pattern.substr(0, field->begin) + number + pattern.substr(field->begin + field->length);
}

bool has_frame_field(const std::string& pattern) {
    return find_field(pattern).has_value();
}

}  // namespace isotrack

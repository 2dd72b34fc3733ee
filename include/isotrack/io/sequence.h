// A time series of VDB files: which frames there are and in which order.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace isotrack {

struct InputFrame {
    /// From the last digits of the file's name before the extension; a file without digits (or with more than
    /// an int can hold) takes its place in the list, counted from 0.
    int number = 0;
    std::string path;
};

struct FrameRange {
    int first, last;  ///< Both included.
    int step = 1;     ///< > 0
};

struct InputSequence {
    std::vector<InputFrame> frames;  ///< Ascending numbers, each once.
    std::vector<int>
        missing;  ///< Numbers without a file: between the first and the last one, or in the range asked for.
};

/// Frames of `inputs`: files, folders (every .vdb in them, hidden ones left out), or patterns with `####`,
/// `%04d` or `{}` for the number in the file's name. `#` pads to at least that many digits; `{}` and `%d`
/// match any number of digits, `%04d` at least four. A plain list is put in natural order. A file named twice
/// counts once. \throws OptionError when an input or the range matches nothing, when two files have the same
/// number, for a pattern with two number fields or one in the folder's name, and when more than a million
/// numbers are missing.
InputSequence find_frames(const std::vector<std::string>& inputs,
                          const std::optional<FrameRange>& range = {});

/// `A:B` or `A:B:STEP` or `A`, both ends included. \throws OptionError.
FrameRange parse_frame_range(const std::string& text);

/// Puts a frame number into a pattern; a pattern without a field is returned as it is.
std::string expand_pattern(const std::string& pattern, int frame);
bool has_frame_field(const std::string& pattern);

}  // namespace isotrack

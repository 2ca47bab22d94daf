# Scripts source this file. `missing NAME CHECK` reports that CHECK needs the tool NAME, which is missing, and exits with code 8.
# If ALLOW_SKIP, a comma-separated list, contains NAME, `missing` only prints that CHECK is skipped.
missing() {
    case ",${ALLOW_SKIP:-}," in
    *",$1,"*) echo "skipped: $2: no $1" ;;
    *)
        echo "$2 needs $1, which is missing: install it, or skip the check with ALLOW_SKIP=$1" >&2
        exit 8
        ;;
    esac
}
